#include "pencilscan/evaluation/true_lines.h"

#include <cmath>
#include <limits>

#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

constexpr float kDark = std::numeric_limits<float>::quiet_NaN();

/// Line coordinate of every channel at every pixel centre (NaN: nothing there). Shadows are left to
/// the refinement, which traces each candidate anyway.
std::vector<std::vector<float>> coordinate_maps(const TruthScene& truth, int camera,
                                                const std::vector<PatternChannel>& channels) {
  const Camera& cam = truth.rig().cameras[static_cast<std::size_t>(camera)];
  const auto width = static_cast<std::size_t>(cam.width);
  const auto height = static_cast<std::size_t>(cam.height);
  std::vector<std::vector<float>> maps(channels.size(), std::vector<float>(width * height, kDark));
  parallel_for(height, [&](std::size_t y) {
    for (std::size_t x = 0; x < width; ++x) {
      const auto hit = truth.hit(camera, {static_cast<double>(x), static_cast<double>(y)});
      if (!hit) continue;
      for (std::size_t c = 0; c < channels.size(); ++c) {
        const auto light = truth.facing(channels[c].projector, hit->point, hit->normal);
        if (!light) continue;
        if (const auto coordinate = truth.line_coordinate(channels[c], light->pixel)) {
          maps[c][y * width + x] = static_cast<float>(*coordinate);
        }
      }
    }
  });
  return maps;
}

/// Moves a crossing along one image axis until the traced coordinate is the integer. Fails where
/// the coordinate jumps over it (a depth step) or the place is dark.
std::optional<TrueLinePixel> refine(const TruthScene& truth, int camera, PatternChannel channel,
                                    int line, Vec2 pixel, Eigen::Index axis) {
  constexpr double kDonePx = 0.02;  // Newton's step; what is left after it is far smaller
  constexpr double kMaxStepPx = 1;  // further away it is not the crossing between these two pixels
  constexpr int kMaxSteps = 6;
  const double start = pixel[axis];
  for (int i = 0; i < kMaxSteps; ++i) {
    const auto sample = sample_line(truth, camera, channel, pixel);
    if (!sample) return std::nullopt;
    const Vec2& g = sample->gradient;
    const double norm = g.norm();
    if (std::abs(g[axis]) < 0.5 * norm || !(norm > 0) || !std::isfinite(norm)) return std::nullopt;
    const double step = (line - sample->coordinate) / g[axis];
    if (std::abs(step) < kDonePx) {
      // One count per line: the axis nearest to the gradient counts it.
      if (std::abs(g[axis]) < std::abs(g[1 - axis])) return std::nullopt;
      return TrueLinePixel{camera,
                           channel,
                           line,
                           pixel,
                           g / norm,
                           1 / norm,
                           sample->hit.cos_camera,
                           sample->light.cos_projector};
    }
    pixel[axis] += step;
    if (std::abs(pixel[axis] - start) > kMaxStepPx) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace

std::vector<TrueLinePixel> true_line_pixels(const TruthScene& truth, int camera,
                                            const TrueLineOptions& options) {
  const Camera& cam = truth.rig().cameras[static_cast<std::size_t>(camera)];
  if (cam.sees_texture_only) return {};
  const auto channels = pattern_channels(truth.rig());
  const auto maps = coordinate_maps(truth, camera, channels);
  const auto width = static_cast<std::size_t>(cam.width);
  const auto height = static_cast<std::size_t>(cam.height);

  std::vector<std::vector<TrueLinePixel>> rows(height);
  parallel_for(height, [&](std::size_t y) {
    const auto look = [&](std::size_t c, std::size_t x, Eigen::Index axis) {
      const std::size_t i = y * width + x;
      const double a = static_cast<double>(maps[c][i]);
      const double b = static_cast<double>(maps[c][i + (axis == 0 ? 1 : width)]);
      // NaN fails the test; a step beyond 1 / min_spacing is a depth step or too dense.
      if (!(std::abs(b - a) * options.min_spacing_px <= 1)) return;
      // A pixel exactly on a line belongs to the interval that starts there.
      const double low = std::min(a, b);
      const double line = std::ceil(low);
      if (line >= std::max(a, b) && !(a == line)) return;
      if (b == line && a != b) return;
      Vec2 start(static_cast<double>(x), static_cast<double>(y));
      if (b != a) start[axis] += (line - a) / (b - a);
      const auto found = refine(truth, camera, channels[c], static_cast<int>(line), start, axis);
      if (found && found->spacing_px >= options.min_spacing_px) rows[y].push_back(*found);
    };
    for (std::size_t x = 0; x < width; ++x) {
      for (std::size_t c = 0; c < channels.size(); ++c) {
        if (x + 1 < width) look(c, x, 0);
        if (y + 1 < height) look(c, x, 1);
      }
    }
  });
  std::vector<TrueLinePixel> all;
  for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
  return all;
}

double distance_to_true_line(const TruthScene& truth, int camera, PatternChannel channel, int line,
                             const Vec2& pixel) {
  constexpr double kDonePx = 1e-3;
  constexpr int kMaxSteps = 5;
  Vec2 at = pixel;
  double distance = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kMaxSteps; ++i) {
    const auto sample = sample_line(truth, camera, channel, at);
    if (!sample) break;
    const double squared = sample->gradient.squaredNorm();
    if (!(squared > 0) || !std::isfinite(squared)) break;
    const Vec2 step = (line - sample->coordinate) / squared * sample->gradient;
    const double next = (at + step - pixel).norm();
    if (i > 0 && step.norm() > distance + 1) break;  // walked over a depth step: keep what was
    distance = next;
    at += step;
    if (step.norm() < kDonePx) break;
  }
  return distance;
}

}  // namespace pencilscan
