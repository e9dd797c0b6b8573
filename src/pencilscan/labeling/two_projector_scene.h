#pragma once

#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {

/// Two projectors with skew axes and two cameras before a bumpy surface: the paper's minimum, and
/// one more camera for the multi-view solution. Curves are made from geometry alone, without
/// images.
struct TwoProjectorScene {
  TwoProjectorScene() {
    rig = sample::two_by_two(
        sample::device_at<Camera>({1100, -250, 150}, "cam0", 1280, 960, 2300),
        sample::device_at<Projector>({1000, 500, 100}, "proj0", 1280, 1024, 2400),
        sample::device_at<Projector>({857, -312, 615}, "proj1", 1280, 1024, 2400), 150);
    families = color_families(rig);
  }

  /// World point of the surface x = bump(y, z).
  static Vec3 surface(double y, double z) {
    return {20 * std::cos(y / 25) * std::cos(z / 30) - y * y / 400 - z * z / 500, y, z};
  }

  /// Curves of one camera: for every line, points where the surface has that line coordinate.
  GridGraph graph(int camera, double half_size_mm, double noise_px, std::uint64_t seed) const {
    GridGraph graph;
    graph.camera = camera;
    Random random(seed);
    for (int p = 0; p < static_cast<int>(rig.projectors.size()); ++p) {
      const Projector& projector = rig.projectors[static_cast<std::size_t>(p)];
      const LinePattern& pattern = projector.patterns.front();
      const auto axis = static_cast<Eigen::Index>(pattern.axis);
      for (int line = 0; line < projector.line_count(pattern); ++line) {
        Curve curve;
        curve.family = p;
        const auto& colors = families[static_cast<std::size_t>(p)];
        const int color =
            colors.color_of_symbol(pattern)[static_cast<std::size_t>(pattern.symbol(line))];
        for (double t = -half_size_mm; t <= half_size_mm; t += 0.5) {
          // Along the line's direction t is fixed, across it the root is found by bisection.
          const auto coordinate = [&](double w) {
            const Vec3 x = p == 0 ? surface(w, t) : surface(t, w);
            return (*projector.project(x))[axis] - pattern.position_px(line);
          };
          double low = -half_size_mm;
          double high = half_size_mm;
          if ((coordinate(low) < 0) == (coordinate(high) < 0)) continue;
          for (int k = 0; k < 50; ++k) {
            const double middle = 0.5 * (low + high);
            ((coordinate(middle) < 0) == (coordinate(low) < 0) ? low : high) = middle;
          }
          const Vec3 x = p == 0 ? surface(low, t) : surface(t, low);
          CurvePoint point;
          point.position = rig.cameras[static_cast<std::size_t>(camera)].project(x)->cast<float>();
          point.position.x() += static_cast<float>(random.normal(0, noise_px));
          point.position.y() += static_cast<float>(random.normal(0, noise_px));
          point.sigma_px = 0.05F;
          curve.points.push_back(point);
          for (int k = 0; k < 2; ++k) curve.code.push_back(k == color ? 0.F : code_evidence);
        }
        if (curve.points.size() < 8) continue;
        graph.curves.push_back(curve);
        graph.identities.push_back({PatternRef{p, 0}, pattern.local_id(line), 1});
        true_lines[static_cast<std::size_t>(camera)].push_back(line);
      }
    }
    graph.crossings = find_crossings(graph.curves, {1280, 960});
    graph.component_of_curve.assign(graph.curves.size(), 0);
    graph.component_count = 1;
    return graph;
  }

  Rig rig;
  std::vector<ColorFamily> families;
  float code_evidence = -1;  ///< log-likelihood of the colour that a line has not
  mutable std::vector<int> true_lines[2];
};

}  // namespace pencilscan
