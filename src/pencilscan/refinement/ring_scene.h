#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <optional>

#include "pencilscan/core/random.h"
#include "pencilscan/refinement/refine_rig.h"

namespace pencilscan {

/// Four cameras and four projectors before a bumpy surface, and its crossings as tracks: geometry
/// alone, without images or labels.
struct RingScene {
  explicit RingScene(bool has_distortion = false) {
    for (int k = 0; k < 4; ++k) {
      const double azimuth = 0.35 * (k - 1.5);
      Camera camera;
      camera.name = "cam" + std::to_string(k);
      camera.width = 1280;
      camera.height = 960;
      camera.K << 2300, 0, 640, 0, 2290, 480, 0, 0, 1;
      if (has_distortion) camera.distortion = {-0.1, 0.05, 0.001, -0.0005, 0.01};
      camera.device_from_world =
          look_at({1100 * std::cos(azimuth), 1100 * std::sin(azimuth), 120.0 * (k % 2)},
                  Vec3::Zero(), 0.1 * k);
      rig.cameras.push_back(camera);
      Projector projector;
      projector.name = "proj" + std::to_string(k);
      projector.width = 1280;
      projector.height = 1024;
      projector.K << 2400, 0, 640, 0, 2410, 512, 0, 0, 1;
      if (has_distortion) projector.distortion = {-0.08, 0.02, -0.001, 0.001, 0};
      LinePattern pattern;
      pattern.axis = k % 2 == 0 ? Axis::kColumn : Axis::kRow;
      projector.patterns = {pattern};
      const double between = azimuth + 0.17;
      projector.device_from_world =
          look_at({1000 * std::cos(between), 1000 * std::sin(between), k % 2 == 0 ? -60.0 : 600.0},
                  Vec3::Zero());
      rig.projectors.push_back(projector);
    }
    rig.volume = Sphere{Vec3::Zero(), 150};
  }

  /// World point of the surface x = bump(y, z).
  static Vec3 surface(double y, double z) {
    return {20 * std::cos(y / 25) * std::cos(z / 30) - y * y / 200 - z * z / 300, y, z};
  }

  /// The surface point on two lines, by Newton's method; nothing outside |y|, |z| < half_size.
  [[nodiscard]] std::optional<Vec3> crossing(const LineOfProjector& a, const LineOfProjector& b,
                                             double half_size_mm) const {
    const auto miss = [&](const Vec2& at) {
      const Vec3 x = surface(at.x(), at.y());
      const auto of = [&](const LineOfProjector& line) {
        const Projector& projector = rig.projectors[static_cast<std::size_t>(line.projector)];
        return (*projector.project(x))[static_cast<Eigen::Index>(line.axis)] - line.coordinate_px;
      };
      return Vec2(of(a), of(b));
    };
    Vec2 at = Vec2::Zero();
    for (int k = 0; k < 30; ++k) {
      constexpr double kStep = 1e-4;
      const Vec2 r = miss(at);
      Eigen::Matrix2d slope;
      slope.col(0) = (miss(at + Vec2(kStep, 0)) - r) / kStep;
      slope.col(1) = (miss(at + Vec2(0, kStep)) - r) / kStep;
      const Vec2 step = slope.partialPivLu().solve(-r);
      if (!step.allFinite()) return std::nullopt;
      at += step * std::min(1.0, 20 / step.norm());
    }
    if (miss(at).norm() > 1e-6 || at.cwiseAbs().maxCoeff() > half_size_mm) return std::nullopt;
    return surface(at.x(), at.y());
  }

  /// Crossings of every stride-th line of projectors p < q with different orientations, seen by
  /// all cameras with noise; points start a little off.
  [[nodiscard]] std::vector<CrossingTrack> tracks(int stride, double noise_px, std::uint64_t seed,
                                                  double half_size_mm = 60) const {
    Random random(seed);
    std::vector<CrossingTrack> result;
    const int projectors = static_cast<int>(rig.projectors.size());
    for (int p = 0; p < projectors; ++p) {
      for (int q = p + 1; q < projectors; ++q) {
        const auto line = [&](int projector, int index) -> LineOfProjector {
          const LinePattern& pattern =
              rig.projectors[static_cast<std::size_t>(projector)].patterns.front();
          return {projector, pattern.axis, pattern.position_px(index)};
        };
        if (line(p, 0).axis == line(q, 0).axis) continue;
        for (int i = 0; i < 80; i += stride) {
          for (int j = 0; j < 80; j += stride) {
            const auto x = crossing(line(p, i), line(q, j), half_size_mm);
            if (!x) continue;
            CrossingTrack track{{line(p, i), line(q, j)}, {}, *x + Vec3(0.2, -0.1, 0.1)};
            for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
              const Vec2 noise(random.normal(0, noise_px), random.normal(0, noise_px));
              const double sigma = std::max(noise_px, 0.01);
              track.sightings.push_back({static_cast<int>(c), *rig.cameras[c].project(*x) + noise,
                                         Eigen::Matrix2d::Identity() / sigma});
            }
            truth.push_back(*x);
            result.push_back(std::move(track));
          }
        }
      }
    }
    return result;
  }

  /// Every device moved by this much into a random direction.
  [[nodiscard]] RigCorrection errors(double rotation_px, double translation_mm,
                                     std::uint64_t seed) const {
    Random random(seed);
    const auto direction = [&] {
      return Vec3(random.normal(), random.normal(), random.normal()).normalized();
    };
    RigCorrection result;
    for (std::size_t d = 0; d < device_count(rig); ++d)
      result.push_back({rotation_px * direction(), translation_mm * direction()});
    return result;
  }

  Rig rig;
  mutable std::vector<Vec3> truth;  ///< surface points of all tracks made
};

}  // namespace pencilscan
