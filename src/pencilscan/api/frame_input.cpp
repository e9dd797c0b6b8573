#include "pencilscan/api/frame_input.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/depth/depth_image.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/pipeline/curve_output.h"
#include "pencilscan/pipeline/frame_files.h"
#include "pencilscan/pipeline/frame_output.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// One image per camera of the rig, CV_32FC3; empty where there is none.
std::vector<cv::Mat> camera_images(const Rig& rig, const Images& images,
                                   const std::string& argument) {
  std::vector<cv::Mat> result(rig.cameras.size());
  std::size_t known = 0;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    const auto at = images.find(camera.name);
    if (at == images.end()) continue;
    ++known;
    const cv::Mat& stored = at->second.stored();
    if (stored.cols != camera.width || stored.rows != camera.height) {
      throw InputError(argument, camera.name,
                       std::to_string(stored.cols) + "x" + std::to_string(stored.rows),
                       "must be " + std::to_string(camera.width) + "x" +
                           std::to_string(camera.height) + " (width x height) as the rig's camera");
    }
    // Far outside [0, 1] means bytes as numbers; a little above it an image that was worked on.
    if (stored.depth() == CV_32F && !cv::checkRange(stored, true, nullptr, -1, 2)) {
      throw InputError(
          argument, camera.name, "",
          "float pixels must be finite and lie in [0, 1], or not far outside (-1 to 2)");
    }
    check_channels(camera, stored.channels(), argument);
    result[c] = stored;
  }
  if (known == images.size()) return result;
  for (const auto& [name, image] : images) {
    const bool is_known = std::any_of(rig.cameras.begin(), rig.cameras.end(),
                                      [&](const Camera& camera) { return camera.name == name; });
    if (!is_known)
      throw InputError(argument, "camera", name, "must be one of the rig: " + camera_names(rig));
  }
  return result;
}

std::vector<CameraDepth> depth_of(const Rig& rig, const DepthResult& depth) {
  std::vector<CameraDepth> result;
  for (const DepthMap& map : depth.maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    DepthImage image = depth_image(camera, map);
    result.push_back({camera.name, std::move(image.depth), std::move(image.sigma)});
  }
  return result;
}

}  // namespace

std::span<const std::string_view> told_stages() {
  static constexpr std::array<std::string_view, 8> kStages = {
      "detection",     "grid",  "solution", "guided matching",
      "triangulation", "depth", "surface",  "guided matching on the surface"};
  return kStages;
}

Frame frame_of(const Rig& rig, const Images& images, const ReconstructionOptions& options) {
  Frame frame;
  frame.name = options.frame;
  frame.images = camera_images(rig, images, "images");
  if (!has_pictures(frame))
    throw InputError("images", "", "", "must hold the picture of at least one camera of the rig");
  if (!options.plain.empty()) frame.plain = camera_images(rig, options.plain, "plain");
  return frame;
}

FrameOptions frame_options(const Rig& rig, const ReconstructionOptions& options) {
  if (options.threads < 0)
    throw InputError("options", "threads", std::to_string(options.threads), "must be >= 0");
  FrameOptions frame;
  frame.meshes = options.mesh;
  PointOptions& points = frame.points;
  const SolutionMethod* method = find_method(options.method);
  if (method == nullptr) {
    std::vector<std::string> names = method_names();
    std::sort(names.begin(), names.end());
    const std::string last = names.back();
    names.pop_back();
    throw InputError("options", "method", options.method,
                     "must be " + name_list(names) + " or " + last);
  }
  points.method = method->defaults;
  if (!set_multiview_cost(options.multiview_cost, points.method)) {
    throw InputError("options", "multiview_cost", options.multiview_cost,
                     "must be normalized or published");
  }
  require_patterns(rig, "rig", "there is nothing to see of this projector");
  const std::string_view rule = broken_rule(rig, points.method);
  if (!rule.empty()) throw InputError("rig", "projectors", "", std::string(rule));
  frame.shape.depth.enabled = options.depth && method->capabilities.allows_dense_depth;
  if (options.depth_maps && !(frame.meshes && frame.shape.depth.enabled))
    throw InputError("options", "depth_maps", "true",
                     "needs a mesh, depth, and the method joint: there would be none");
  return frame;
}

Reconstruction reconstruction_of(const Rig& rig, const Frame& frame, FrameResult found,
                                 bool depth_maps) {
  Reconstruction result;
  result.unit_known = rig.unit_known;
  result.report = json_text(frame_report(rig, frame, found.points, found.shape));
  result.curves = describe_curves(rig, found.points);
  if (depth_maps) result.depth = depth_of(rig, found.shape.depth);
  result.points = std::move(found.points.points);
  result.mesh = std::move(found.shape.surface.mesh);
  result.measured = std::move(found.shape.surface.measured);
  return result;
}

}  // namespace pencilscan
