#include "pencilscan/depth/depth.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/check.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/depth/pruning.h"
#include "pencilscan/depth/wide_windows.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// 1 where nothing is overexposed.
cv::Mat unsaturated(const cv::Mat& values) {
  cv::Mat valid;
  cv::bitwise_and(~overexposed(values), 1, valid);
  return valid;
}

Background background_of(const Rig& rig, std::span<const MeasuredPoint> points, int camera) {
  Background background{ObjectSpace(rig), {}};
  for (const MeasuredPoint& p : points)
    if (p.camera == camera) background.points.push_back(p);
  return background;
}

CameraDepthReport camera_report(const DepthMap& map, double blur_px) {
  CameraDepthReport report;
  report.camera = map.camera;
  report.blur_px = blur_px;
  std::vector<float> sigmas;
  for (const DepthNode& node : map.nodes) {
    if (node.measured()) sigmas.push_back(node.sigma);
  }
  report.measured = sigmas.size();
  report.sigma_median_mm = static_cast<double>(upper_median(std::move(sigmas)));
  return report;
}

}  // namespace

DepthResult measure_depth(const Rig& rig, const std::vector<ColorFamily>& families,
                          std::span<const cv::Mat> images,
                          std::span<const CameraDetection> detections,
                          std::span<const MeasuredPoint> points, const DepthStageOptions& options,
                          std::span<const MeasuredPoint> background) {
  PENCILSCAN_CHECK(images.size() == rig.cameras.size() && detections.size() == images.size());
  DepthResult result;
  std::vector<std::size_t> cameras;
  for (std::size_t c = 0; c < images.size(); ++c) {
    if (!images[c].empty() && !rig.cameras[c].sees_texture_only) cameras.push_back(c);
  }
  result.maps.resize(cameras.size());
  result.lights.resize(cameras.size());
  parallel_for(cameras.size(), [&](std::size_t i) {
    const std::size_t c = cameras[i];
    const Camera& camera = rig.cameras[c];
    const Unmixing& unmixing = detections[c].unmixing;
    std::vector<cv::Mat> sampled;
    for (const ColorFamily& family : families)
      sampled.push_back(presence_samples(camera, unmixing, family));
    CameraLight& light = result.lights[i];
    light.camera = &camera;
    light.families = detections[c].presence;
    light.sampled = std::move(sampled);
    light.valid = unsaturated(images[c]);
    light.spacing_px = static_cast<float>(pixels_at_center(rig, camera, line_spacing(rig)));
    light.line_px = static_cast<float>(pixels_at_center(rig, camera, line_width(rig)));
    light.of_mosaic = camera.mosaic || detections[c].is_filled_in;
    const DepthOptions depth = options_for(light, options.depth);
    for (std::size_t f = 0; f < families.size(); ++f) {
      for (const PatternRef& ref : families[f].patterns) {
        light.patterns.emplace_back(rig, camera, ref.projector, ref.pattern);
        light.patterns.back().set_family(static_cast<int>(f));
      }
    }
    light.noise.assign(families.size(), NoiseModel{});
    measure_light(pilot_windows(light, static_cast<int>(c), points, depth), depth.half, light);
    const Background behind = background_of(rig, background, static_cast<int>(c));
    result.maps[i] = dense_depth(light, static_cast<int>(c), points, behind, depth);
    with_wider_windows(
        light, binning_for(static_cast<double>(light.spacing_px), depth), result.maps[i],
        [&](const CameraLight& wide, DepthMap& map) { grow(wide, behind, depth, map); });
  });

  std::vector<int> pattern_projector;
  for (const ColorFamily& family : families) {
    for (const PatternRef& ref : family.patterns) pattern_projector.push_back(ref.projector);
  }
  result.report.consistency =
      check_consistency(rig, pattern_projector, result.maps, options.consistency);
  for (std::size_t i = 0; i < cameras.size(); ++i)
    result.report.cameras.push_back(
        camera_report(result.maps[i], static_cast<double>(result.lights[i].blur_px)));
  return result;
}

void guided_depth(const Rig& rig, const RayScene& surface, const DepthStageOptions& options,
                  std::span<const MeasuredPoint> background, DepthResult& result) {
  PENCILSCAN_CHECK(result.lights.size() == result.maps.size());
  std::vector<std::size_t> found(result.maps.size());
  parallel_for(result.maps.size(), [&](std::size_t i) {
    DepthMap& map = result.maps[i];
    const Background behind = background_of(rig, background, map.camera);
    DepthOptions depth = options_for(result.lights[i], options.depth);
    depth.max_move = std::max(depth.max_move, depth.max_move_lines * line_spacing(rig));
    const auto completed = [&](const CameraLight& light, DepthMap& completing) {
      std::size_t count = 0;
      const auto complete = [&](const CameraLight& seen, DepthMap& nodes) {
        count += complete_map(seen, surface, behind, result.report.consistency.sigma_factor, depth,
                              nodes);
      };
      complete(light, completing);
      // Where a surface turns from its projector, lines lie farther apart.
      const int widest = std::max(2, binning_for(static_cast<double>(light.spacing_px), depth));
      with_wider_windows(light, widest, completing, complete);
      return count;
    };
    if (result.lights[i].is_measured) {
      found[i] = completed(result.lights[i], map);
      return;
    }
    // Labels told little of its blur and noise. The surface of other cameras may tell more.
    CameraLight light = result.lights[i];
    measure_light(pilot_windows(light, surface, map, depth), depth.half, light);
    DepthMap again = map;
    const std::size_t found_again = completed(light, again);
    found[i] = completed(result.lights[i], map);
    if (found_again <= found[i]) return;
    found[i] = found_again;
    map = std::move(again);
    result.report.cameras[i].blur_px = static_cast<double>(light.blur_px);
    result.lights[i] = std::move(light);
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    const std::size_t lone = drop_lone_guided_nodes(result.maps[i]);
    result.report.completed += found[i] - std::min(found[i], lone);
    result.report.cameras[i].measured += found[i];
    result.report.cameras[i].measured -= lone;
  }
}

}  // namespace pencilscan
