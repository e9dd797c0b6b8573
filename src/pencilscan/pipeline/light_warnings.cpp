#include "pencilscan/pipeline/light_warnings.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/grid/gamma_trace.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

std::optional<Warning> interpolation_warning(const Rig& rig,
                                             std::span<const CameraDetection> detections) {
  std::string names;
  for (std::size_t c = 0; c < detections.size(); ++c) {
    if (detections[c].is_filled_in) add_name(names, rig.cameras[c].name, ", ");
  }
  if (names.empty()) return std::nullopt;
  return Warning{WarningCode::kColorsFilledIn,
                 "the colours of " + names +
                     " were filled in behind a mosaic: raw pictures, with \"mosaic\" in the rig, "
                     "are more accurate"};
}

std::optional<Warning> gamma_warning(const Rig& rig, const Frame& frame,
                                     std::span<const CameraDetection> detections,
                                     std::span<const GridGraph> graphs) {
  // Pictures whose gamma is stated have .86 to 1.03 of it here (docs/sensors.md, "Gamma").
  constexpr double kWorthSaying = 1.3;
  // Of colours that a mosaic or a JPEG leaves out: these look like a factor of up to 1.4.
  constexpr double kOfFilledIn = 1.5;
  constexpr double kDeviations = 4;  // of the median of all crossings
  std::vector<std::vector<double>> logs(rig.cameras.size());
  parallel_for(rig.cameras.size(), [&](std::size_t c) {
    if (!graphs[c].crossings.empty())
      logs[c] = log_gammas_at_crossings(graphs[c], linear_light(rig.cameras[c], frame.images[c]));
  });
  // Cameras with too few crossings that say something say it together.
  std::vector<double> of_few;
  for (const auto& of_camera : logs)
    if (!gamma_of_crossings(of_camera))
      of_few.insert(of_few.end(), of_camera.begin(), of_camera.end());
  std::vector<double> gammas(rig.cameras.size(), 0);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (logs[c].empty()) continue;
    auto trace = gamma_of_crossings(logs[c]);
    if (!trace) trace = gamma_of_crossings(of_few);
    if (!trace) continue;
    const Camera& camera = rig.cameras[c];
    // Cameras code light with a gamma of one or more. What looks less is paint that is brighter at
    // the crossings than beside them.
    if (camera.gamma * trace->gamma < 1 / kWorthSaying) continue;
    const double off = std::abs(std::log(trace->gamma));
    const double worth_saying =
        detections[c].is_filled_in || camera.mosaic ? kOfFilledIn : kWorthSaying;
    if (off > std::log(worth_saying) && off > kDeviations * trace->deviation)
      gammas[c] = camera.gamma * trace->gamma;
  }
  std::string names;
  double first = 0;
  for (std::size_t c = 0; c < gammas.size(); ++c) {
    if (gammas[c] == 0) continue;
    if (names.empty()) first = gammas[c];
    add_name(names, rig.cameras[c].name + " (" + formatted(gammas[c], "%.1f") + ")", ", ");
  }
  if (names.empty()) return std::nullopt;
  return Warning{WarningCode::kGamma,
                 "where lines cross, light adds up only with another gamma than the rig's: about " +
                     names + "; state it as \"gamma\" of these cameras, or switch it off there",
                 {},
                 {{"gamma", first}}};
}

double signal_to_noise(const PointResult& result) {
  // A profile of amplitude A and Gaussian width w in noise n a pixel is known in its place to
  // sigma^2 = 2 w n^2 / (A^2 sqrt(pi)), the bound of Cramer and Rao.
  std::vector<double> ratios;
  for (const GridGraph& graph : result.graphs)
    for (const Curve& curve : graph.curves)
      for (const CurvePoint& point : curve.points)
        if (point.sigma_px > 0 && point.width_px > 0)
          ratios.push_back(std::sqrt(2 * point.width_px * std::numbers::inv_sqrtpi) /
                           point.sigma_px);
  return upper_median(std::move(ratios));
}

namespace {

/// How far apart neighbouring lines are in the middle camera's picture, at the volume's centre, px.
double line_spacing_px(const Rig& rig) {
  const double spacing = line_spacing(rig);
  std::vector<double> of_cameras;
  for (const Camera& camera : rig.cameras)
    if (!camera.sees_texture_only) of_cameras.push_back(pixels_at_center(rig, camera, spacing));
  return upper_median(std::move(of_cameras));
}

/// The median of a figure of all curve points that have it.
double median_of_points(const PointResult& result, float CurvePoint::*figure) {
  std::vector<double> values;
  for (const GridGraph& graph : result.graphs)
    for (const Curve& curve : graph.curves)
      for (const CurvePoint& point : curve.points)
        if (point.*figure > 0) values.push_back(point.*figure);
  return upper_median(std::move(values));
}

/// Noise of a pixel of such light, as a share of full scale, with a poor sensor: that of `simulate
/// --noise high` (simulation/sensor.cpp), which holds 2,500 electrons and reads with 3/255.
double noise_of_poor_sensor(double light) {
  constexpr double kFullWell = 2500;
  constexpr double kRead = 3.0 / 255;
  return std::sqrt(light / kFullWell + kRead * kRead);
}

}  // namespace

std::optional<Warning> little_light_warning(const Rig& rig, const PointResult& result) {
  // A bunny before four cameras (noise medium) of albedo .1, .06, .04 and .03 has 8.4, 6.9, 6.0 and
  // 5.5, and lacks 4, 13, 35 and 70 % of what is measured of it at albedo .8. A ball of which more
  // than half is lost has 5 to 7. How much of a closed surface is measured tells nothing of light:
  // of one that is seen from one side it is always less than half.
  constexpr double kFaint = 7;
  const double ratio = signal_to_noise(result);
  if (ratio == 0 || ratio > kFaint) return std::nullopt;
  // Profiles of lines that are closer than four of their deviations overlap: it is the neighbours'
  // light that makes places uncertain then, not noise. A grid of pixels shows no deviation below
  // one of them.
  constexpr double kWidthsApart = 4;
  const double spacing = line_spacing_px(rig);
  if (spacing < kWidthsApart) {
    return Warning{WarningCode::kLinesTooClose,
                   "lines are too close together: " + formatted(spacing, "%.1f") +
                       " px (joined ones, where pixels are joined); below " +
                       formatted(kWidthsApart, "%.0f") +
                       " px they lie over each other; joining fewer pixels, cameras of more "
                       "pixels or a wider pitch help",
                   {},
                   {{"line_spacing_px", spacing}}};
  }
  if (spacing < kWidthsApart * median_of_points(result, &CurvePoint::width_px)) return std::nullopt;
  // Bright lines in more than a sensor's noise lie on fine paint or over each other.
  const double height = median_of_points(result, &CurvePoint::amplitude);
  if (height > ratio * noise_of_poor_sensor(height)) return std::nullopt;
  return Warning{WarningCode::kLittleLight,
                 "light is too little: the lines that were found are " + formatted(ratio, "%.1f") +
                     " times as bright as the noise of the pictures (median), and fainter ones "
                     "are lost; longer exposure, a wider aperture or brighter projectors help",
                 {},
                 {{"signal_to_noise", ratio}}};
}

}  // namespace pencilscan
