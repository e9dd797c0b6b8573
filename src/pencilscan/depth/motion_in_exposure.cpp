#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pencilscan/core/parallel.h"
#include "pencilscan/depth/consistency.h"
#include "pencilscan/depth/depth.h"
#include "pencilscan/depth/line_blur.h"

// From depth maps to the motion within the exposure: at which nodes lines are measured, and how
// often.

namespace pencilscan {
namespace {

constexpr double kLeastBlurSpacingPx = 3;

/// True where a node and all around it have depth.
bool is_inside(const DepthMap& map, int row, int column) {
  for (int r = row - 1; r <= row + 1; ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      if (!map.nodes[map.index(r, c)].measured()) return false;
    }
  }
  return true;
}

/// Adds the lines of a node, all or none.
void add_lines(const Rig& rig, const CameraLight& light, const DepthMap& map, std::size_t index,
               std::vector<NodeLines>& lines) {
  const DepthNode& node = map.nodes[index];
  const Camera& camera = *light.camera;
  const Vec2 pixel = map.pixel(index);
  const Vec2 m = camera.normalized_from_pixel(pixel);
  const Eigen::Matrix2d jacobian = camera.pixel_slope(m).inverse();
  const auto w = static_cast<double>(node.w);
  LineBlur blur;
  blur.camera = map.camera;
  blur.point = node_point(rig, map, index);
  blur.normal = node_normal(rig, map, index);
  const Vec3 to_camera = camera.center() - blur.point;
  blur.camera_cosine = blur.normal.dot(to_camera.normalized());
  blur.camera_depth = 1 / w;
  blur.variance_px2 = static_cast<double>(light.blur_px * light.blur_px);
  blur.deviation_px2 = std::numeric_limits<double>::infinity();
  const std::size_t before = lines.size();
  for (std::size_t k = 0; k < light.patterns.size(); ++k) {
    if (!map.lit(node).test(k)) continue;
    const PatternView& view = light.patterns[k];
    bool ok = false;
    const WindowLines at = view.lines(m, jacobian, w, ok);
    const Eigen::Vector2f slope = at.gradient(node.w, node.wx, node.wy);
    const double spacing = 1 / static_cast<double>(slope.norm());
    if (!ok || !(spacing > kLeastBlurSpacingPx)) {
      lines.resize(before);
      return;
    }
    const Projector& projector = rig.projector(view.projector());
    blur.projector = view.projector();
    blur.direction = static_cast<double>(std::atan2(slope[1], slope[0]));
    blur.px_per_line = spacing;
    // The plane omega . x = 1 moved by d along its normal: w changes by w d / (n . x).
    blur.px_per_length =
        std::abs(static_cast<double>(at.slope(node.w)) * w / blur.normal.dot(to_camera)) * spacing;
    blur.projector_cosine = blur.normal.dot((projector.center() - blur.point).normalized());
    blur.projector_depth = (blur.point - projector.center()).dot(projector.forward());
    lines.push_back({index, k, blur});
  }
}

/// Colours at half the resolution, as behind a mosaic or in a JPEG, filled in by lines between
/// them: a triangle of two pixels to either side, along rows and columns, adds so much. (Pictures
/// of a mosaic itself are fitted where it has samples.)
double unknown_blur_px2(std::span<const CameraLight> lights) {
  constexpr double kFilledIn = 2 * 2 / 6.0;
  const bool any = std::any_of(lights.begin(), lights.end(), [](const CameraLight& light) {
    return light.of_mosaic && !light.camera->mosaic;
  });
  return any ? kFilledIn : 0;
}

}  // namespace

std::vector<NodeLines> lines_at_nodes(const Rig& rig, const CameraLight& light, const DepthMap& map,
                                      int stride) {
  std::vector<NodeLines> lines;
  for (int row = 1; row + 1 < map.rows; row += stride) {
    for (int column = 1; column + 1 < map.columns; column += stride) {
      if (is_inside(map, row, column)) add_lines(rig, light, map, map.index(row, column), lines);
    }
  }
  return lines;
}

double window_overlap(const DepthMap& map, int half, int stride) {
  const WindowGrid grid(half);
  double weights = 0;
  for (const float weight : grid.taper) weights += static_cast<double>(weight);
  return std::max(1.0, weights / (map.stride * stride * map.stride * stride));
}

ExposureMotion motion_in_exposure(const Rig& rig, const DepthStageOptions& options,
                                  const DepthResult& result) {
  // Lines of another family that show through widen those of a family, in some directions only.
  const std::vector<ColorFamily> families = color_families(rig);
  if (std::any_of(families.begin(), families.end(),
                  [](const ColorFamily& family) { return family.mixes(); }))
    return {};
  // Windows are 11 px wide, nodes a few: of many nodes, this number in even rows and columns tell
  // as much of one rigid motion as the frame needs (docs/sequences.md), at a fixed cost.
  constexpr double kEnoughWindows = 6000;
  constexpr double kLeastVariancePx2 = 0.05;  // of a start: below, the series has no end
  std::size_t nodes = 0;
  for (const DepthMap& map : result.maps)
    nodes += static_cast<std::size_t>(std::count_if(
        map.nodes.begin(), map.nodes.end(), [](const DepthNode& node) { return node.measured(); }));
  if (nodes == 0) return {};
  const int stride = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(nodes) / kEnoughWindows))));
  const std::size_t cameras = result.maps.size();
  std::vector<std::vector<NodeLines>> lines(cameras);
  ExposureMotion motion;
  // The second round starts from where the first one ended: blur is not linear in its variance.
  for (int round = 0; round < 2; ++round) {
    parallel_for(cameras, [&](std::size_t c) {
      const CameraLight& light = result.lights[c];
      const DepthMap& map = result.maps[c];
      const int half = options_for(light, options.depth).half;
      if (round == 0) {
        lines[c] = lines_at_nodes(rig, light, map, stride);
        const double overlap = window_overlap(map, half, stride);
        for (NodeLines& entry : lines[c]) entry.blur.overlap = overlap;
      }
      measure_blurs(light, map, half, lines[c]);
    });
    std::vector<LineBlur> all;
    for (auto& of_camera : lines) {
      std::erase_if(of_camera,
                    [](const NodeLines& l) { return !std::isfinite(l.blur.deviation_px2); });
      for (const NodeLines& entry : of_camera) all.push_back(entry.blur);
    }
    std::vector<double> expected;
    motion =
        exposure_motion(all, unknown_blur_px2(result.lights), round == 0 ? &expected : nullptr);
    if (expected.empty()) break;
    std::size_t next = 0;
    for (auto& of_camera : lines) {
      for (NodeLines& entry : of_camera)
        entry.blur.variance_px2 = std::max(expected[next++], kLeastVariancePx2);
    }
  }
  return motion;
}

}  // namespace pencilscan
