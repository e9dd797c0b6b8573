#include "pencilscan/detection/detect.h"

#include <algorithm>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/core/parallel.h"
#include "pencilscan/detection/ghosts.h"
#include "pencilscan/detection/missing_channels.h"
#include "pencilscan/detection/mosaic_trace.h"
#include "pencilscan/detection/room_light.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// The part of an image (linear light) that holds everything bright enough to be a line, with a
/// margin for the filters. The object often covers a small part of the image only.
cv::Rect lit_area(const cv::Mat& image) {
  constexpr int kBlock = 8;
  constexpr int kMargin = 24;
  constexpr double kLitShare = 0.04;  // of the brightest block
  cv::Mat blocks;
  cv::resize(image, blocks,
             {(image.cols + kBlock - 1) / kBlock, (image.rows + kBlock - 1) / kBlock}, 0, 0,
             cv::INTER_AREA);
  std::vector<cv::Mat> channels;
  cv::split(blocks, channels);
  const cv::Mat brightest = cv::max(channels[0], cv::max(channels[1], channels[2]));
  double peak = 0;
  cv::minMaxLoc(brightest, nullptr, &peak);
  const cv::Rect lit = cv::boundingRect(brightest > kLitShare * peak);
  const cv::Rect whole(0, 0, image.cols, image.rows);
  if (lit.empty()) return whole;
  return whole & cv::Rect(lit.x * kBlock - kMargin, lit.y * kBlock - kMargin,
                          lit.width * kBlock + 2 * kMargin, lit.height * kBlock + 2 * kMargin);
}

/// Unmixed light without the room's. Colours that were found in the light of both are found again.
cv::Mat projector_light_alone(const Camera& camera, const Rig& rig,
                              const std::vector<ColorFamily>& families, const cv::Mat& rgb,
                              double pitch_px, Unmixing& unmixing) {
  cv::Mat alone = without_room_light(rgb, pitch_px);
  if (camera.states_color_matrix()) return alone;
  const Mat3 back = unmixing.projector_from_camera.inverse();
  unmixing = estimate_unmixing(camera, rig, families, mixed(alone, back));
  return mixed(alone, unmixing.projector_from_camera * back);
}

}  // namespace

CameraDetection detect_curves(const Camera& camera, const Rig& rig,
                              const std::vector<ColorFamily>& families, const cv::Mat& image,
                              const DetectionOptions& options) {
  CameraDetection result;
  // Unmix the colour families where there is light.
  const cv::Mat values = camera_values(camera, image);
  const cv::Mat whole = linear_light(camera, values);
  const cv::Rect area = lit_area(whole);
  const cv::Mat linear = whole(area);
  result.is_filled_in = !camera.mosaic && looks_interpolated(values);
  result.saturated_pixels = static_cast<std::size_t>(cv::countNonZero(overexposed(image(area))));
  result.unmixing = estimate_unmixing(camera, rig, families, registered(camera, linear, area.tl()));
  cv::Mat rgb = projector_light(camera, linear, result.unmixing, area.tl());
  const double pitch_px = pixels_at_center(rig, camera, line_spacing(rig));
  if (lines_lack_a_channel(families) && room_shows_prints(rgb, pitch_px))
    rgb = projector_light_alone(camera, rig, families, rgb, pitch_px, result.unmixing);
  // Find and trace the curves of each family, then fit them together.
  RidgeOptions ridge = options.ridge;
  ridge.usual_px = pixels_at_center(rig, camera, line_width(rig));
  std::vector<std::vector<Curve>> curves_of(families.size());
  result.presence.resize(families.size());
  parallel_for(families.size(), [&](std::size_t f) {
    const cv::Mat presence = presence_image(rgb, families[f]);
    const std::vector<Ridgel> ridgels = find_ridgels(presence, ridge);
    std::vector<Curve> curves = trace_curves(ridgels, presence.size(), options.trace);
    for (Curve& curve : curves) curve.family = static_cast<int>(f);
    RefineOptions refine = options.refine;
    refine.sizes = std::max(refine.sizes, sizes_of(ridgels));
    curves = refine_curves(presence, std::move(curves), refine);
    curves_of[f] = without_ghosts(presence, std::move(curves), refine.min_points);
    const cv::Mat samples = presence_samples(camera, result.unmixing, families[f]);
    if (!samples.empty())
      curves_of[f] = refit_to_samples(presence, samples(area), std::move(curves_of[f]), refine);
    // Dark outside the lit area.
    result.presence[f] = cv::Mat(image.size(), CV_32F, cv::Scalar(0));
    presence.copyTo(result.presence[f](area));
  });
  for (std::vector<Curve>& curves : curves_of) {
    std::move(curves.begin(), curves.end(), std::back_inserter(result.curves));
  }
  // Read the colour code along each curve.
  measure_code(rgb, families, result.curves, options.code);
  allow_for_missing_channels(families, rgb.size(), pitch_px, result.curves);
  const Eigen::Vector2f corner(static_cast<float>(area.x), static_cast<float>(area.y));
  for (Curve& curve : result.curves) {
    for (CurvePoint& point : curve.points) point.position += corner;
  }
  return result;
}

std::vector<std::vector<cv::Mat>> presence_images(std::span<const CameraDetection> detections) {
  std::vector<std::vector<cv::Mat>> presence;
  for (const CameraDetection& detection : detections) presence.push_back(detection.presence);
  return presence;
}

}  // namespace pencilscan
