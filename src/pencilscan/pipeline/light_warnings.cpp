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
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/view/unmix.h"

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

namespace {

// Crossings say .7 to 1.05 of the gamma that values have, of JPEG 75 .64: halved and filled-in
// colours and coarse values take light from crossings more than from the lines beside them
// (docs/sensors.md, "Gamma"). All that errs downwards.
constexpr double kAbove = 1.3;          // the one that is stated, to be worth saying
constexpr double kBelow = 2;            // likewise
constexpr double kGammaDeviations = 4;  // of the median of all crossings

/// Whether a gamma other than the stated one is beyond doubt.
bool is_another_gamma(const GammaTrace& trace, double stated) {
  // Cameras code light with a gamma of one or more. What looks less is paint that is brighter at
  // the crossings than beside them.
  if (trace.gamma < 1 / kAbove) return false;
  const double off = std::log(trace.gamma / stated);
  return std::abs(off) > std::log(off < 0 ? kBelow : kAbove) &&
         std::abs(off) > kGammaDeviations * trace.deviation;
}

/// Whether values may be light, or are beyond doubt no light of such a gamma.
bool is_told(const std::optional<GammaTrace>& trace) {
  if (!trace) return false;
  const double log_gamma = std::log(trace->gamma);
  const double unsure = kGammaDeviations * trace->deviation;
  return log_gamma + unsure < std::log(kAbove) || log_gamma - unsure > 0;
}

}  // namespace

std::vector<std::optional<GammaTrace>> gammas_of_light(const Rig& rig, const Frame& frame,
                                                       std::span<const GridGraph> graphs) {
  std::vector<std::vector<CrossingGamma>> said(rig.cameras.size());
  parallel_for(rig.cameras.size(), [&](std::size_t c) {
    if (graphs[c].crossings.empty()) return;
    // Colours are halved and filled in as values, before a gamma is taken out.
    Camera camera = rig.cameras[c];
    camera.gamma = 1;
    said[c] = gammas_at_crossings(graphs[c], linear_light(camera, frame.images[c]));
  });
  std::vector<std::optional<GammaTrace>> gammas(rig.cameras.size());
  std::vector<CrossingGamma> of_few;
  for (std::size_t c = 0; c < said.size(); ++c) {
    gammas[c] = gamma_of_crossings(said[c]);
    if (!gammas[c]) of_few.insert(of_few.end(), said[c].begin(), said[c].end());
  }
  const std::optional<GammaTrace> together = gamma_of_crossings(of_few);
  for (std::size_t c = 0; c < said.size(); ++c)
    if (!gammas[c] && !said[c].empty()) gammas[c] = together;
  return gammas;
}

std::optional<Warning> gamma_warning(const Rig& rig,
                                     std::span<const std::optional<GammaTrace>> gammas) {
  std::string names;
  double first = 0;
  for (std::size_t c = 0; c < gammas.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    if (!gammas[c] || !is_another_gamma(*gammas[c], camera.gamma)) continue;
    const double gamma = gammas[c]->gamma;
    if (names.empty()) first = gamma;
    add_name(names, camera.name + " (" + formatted(gamma, "%.1f") + ")", ", ");
  }
  if (names.empty()) return std::nullopt;
  return Warning{WarningCode::kGamma,
                 "where lines cross, light adds up only with another gamma than the rig's: about " +
                     names +
                     " (JPEG shows less than there is; cameras that code pictures for the eye "
                     "mostly have 2.2); state it as \"gamma\" of these cameras, or switch it off "
                     "there",
                 {},
                 {{"gamma", first}}};
}

std::string gamma_note(const Rig& rig, const Frame& frame,
                       std::span<const std::optional<GammaTrace>> gammas) {
  std::string names;
  for (std::size_t c = 0; c < gammas.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    const cv::Mat& image = frame.images[c];
    if (image.empty() || image.depth() != CV_8U || camera.gamma != 1 || camera.sees_texture_only ||
        is_told(gammas[c]))
      continue;
    add_name(names, camera.name, ", ");
  }
  if (names.empty()) return names;
  return "Too few lines cross to tell whether the pictures of " + names +
         " are linear light: if these cameras code light for the eye, as for JPEG, switch that "
         "off, or state their \"gamma\" in the rig (mostly 2.2).";
}

namespace {

/// The share of its pixels in which a camera has samples of each family's presence.
std::vector<double> sampled_shares(const Rig& rig, const PointResult& result, std::size_t c) {
  std::vector<double> shares(result.families.size(), 1);
  if (c >= rig.cameras.size() || !rig.cameras[c].mosaic) return shares;
  Camera camera = rig.cameras[c];
  camera.width = camera.height = 2;  // a mosaic repeats itself after so many
  for (std::size_t f = 0; f < shares.size(); ++f) {
    const cv::Mat samples =
        presence_samples(camera, result.detections[c].unmixing, result.families[f]);
    if (!samples.empty()) shares[f] = cv::countNonZero(samples) / 4.;
  }
  return shares;
}

}  // namespace

double signal_to_noise(const Rig& rig, const PointResult& result) {
  // A profile of amplitude A and Gaussian width w in noise n of a sample is known in its place to
  // sigma^2 = 2 w n^2 / (A^2 sqrt(pi) s), the bound of Cramer and Rao, with s samples a pixel.
  std::vector<double> ratios;
  for (std::size_t c = 0; c < result.graphs.size(); ++c) {
    const std::vector<double> shares = sampled_shares(rig, result, c);
    for (const Curve& curve : result.graphs[c].curves) {
      const auto family = static_cast<std::size_t>(curve.family);
      const double share = family < shares.size() ? shares[family] : 1;
      for (const CurvePoint& point : curve.points)
        if (point.sigma_px > 0 && point.width_px > 0)
          ratios.push_back(std::sqrt(2 * point.width_px * std::numbers::inv_sqrtpi / share) /
                           point.sigma_px);
    }
  }
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
  const double ratio = signal_to_noise(rig, result);
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
  if (spacing < kWidthsApart * median_of_points(result.graphs, &CurvePoint::width_px))
    return std::nullopt;
  // Bright lines in more than a sensor's noise lie on fine paint or over each other.
  const double height = median_of_points(result.graphs, &CurvePoint::amplitude);
  if (height > ratio * noise_of_poor_sensor(height)) return std::nullopt;
  return Warning{WarningCode::kLittleLight,
                 "light is too little, or spread by pictures out of focus: the lines that were "
                 "found are " +
                     formatted(ratio, "%.1f") +
                     " times as bright as the noise of the pictures (median), and fainter ones "
                     "are lost; longer exposure or brighter projectors help, or sharper pictures",
                 {},
                 {{"signal_to_noise", ratio}}};
}

}  // namespace pencilscan
