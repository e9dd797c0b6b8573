#include "pencilscan/pipeline/frame_warnings.h"

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
#include "pencilscan/rig/device_list.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {

std::vector<Warning> detection_warnings(const Rig& rig, const Frame& frame,
                                        std::span<const ColorFamily> families,
                                        std::span<const CameraDetection> detections) {
  std::vector<Warning> warnings = frame.notes;
  for (const ColorFamily& family : families) {
    if (!family.mixes()) continue;
    std::string names;
    for (const PatternColor& color : family.colors) add_name(names, color.text(), "/");
    warnings.push_back({WarningCode::kColorsMix, "the colours " + names +
                                                     " cannot be told apart from those of other "
                                                     "projectors"});
  }
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const Camera& camera = rig.cameras[c];
    if (camera.sees_texture_only) continue;
    const std::string who = "camera " + camera.name;
    if (frame.images[c].empty()) {
      warnings.push_back(
          {WarningCode::kNoPicture,
           who + " has no image in frame " + frame.name + ": reconstructed without it",
           camera.name});
      continue;
    }
    if (detections[c].curves.empty())
      warnings.push_back(
          {WarningCode::kNoLines, who + ": no projected line was found in its image", camera.name});
    const double saturated = static_cast<double>(detections[c].saturated_pixels) /
                             static_cast<double>(frame.images[c].total());
    if (saturated > 0.01) {
      warnings.push_back({WarningCode::kSaturated,
                          who + ": " + std::to_string(static_cast<int>(100 * saturated)) +
                              " % of its pixels are saturated; lower exposure or gain",
                          camera.name,
                          {{"share", saturated}}});
    }
  }
  return warnings;
}

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

Warning alike_warning(const std::string& projectors) {
  return {WarningCode::kColorsMix,
          "the lines of " + projectors +
              " are all seen in one colour, and are named by their crossings alone: the object "
              "hardly gives back what tells their colours apart, or the projector or the camera "
              "lacks it; other colours in the pattern find more lines"};
}

Warning naming_warning(const std::string& doubt) {
  return {WarningCode::kNamesDoubtful,
          doubt +
              ": a device stands farther from where the rig has it than this frame can tell, "
              "shows or sees something else, or a dark pattern on the object cuts its lines into "
              "pieces; rig check --frames looks at several frames"};
}

Warning rig_warning(const CrossingDisagreement& crossings, RigInFrame rig_in_frame) {
  const char* const done = [&] {
    switch (rig_in_frame) {
      case RigInFrame::kCorrected:
        return "Lines were named with the devices as this frame corrects them, points lie where "
               "the rig as given puts them; --refine-rig can correct the points too";
      case RigInFrame::kPartlyCorrected:
        return "Lines were named with the devices as this frame corrects them, which is not all "
               "that is wrong: many may be named wrong";
      case RigInFrame::kAsGiven:
        break;
    }
    return "This frame does not say how, many lines may be named wrong; --refine-rig can correct "
           "it from several frames";
  }();
  return {
      WarningCode::kRigIsOff,
      "crossing lines miss each other by " + formatted(crossings.median_px, "%.2f") +
          " projector pixels (median) where image noise explains " +
          formatted(crossings.expected_px, "%.2f") +
          ": the rig's calibration is off (or the object moved between colours that a projector "
          "shows one after another). " +
          done,
      {},
      {{"median_px", crossings.median_px}, {"expected_px", crossings.expected_px}}};
}

namespace {

// Right devices with so many crossings reach 1.8 times what noise explains (2,293 results of drawn
// rigs, artefacts, films and a path tracer); a projector that zooms by 2 % 6 times.
constexpr std::size_t kEnoughCrossings = 200;
constexpr double kFarOverNoise = 2.5;

double over_noise(double miss_px, const CrossingDisagreement& d) {
  return miss_px / std::max(0.05, d.expected_px);
}

double squared(double x) { return x * x; }

/// What a device's crossings miss without what those of all of its kind miss beyond noise, px. That
/// the object does, whose light spreads below its surface, and it adds in squares.
double own_miss(std::size_t device, std::span<const CrossingDisagreement> of_kind) {
  double common2 = squared(of_kind[device].median_px);
  bool is_alone = true;
  for (std::size_t k = 0; k < of_kind.size(); ++k) {
    if (k == device || of_kind[k].crossings < kEnoughCrossings) continue;
    const double beyond = squared(of_kind[k].median_px) - squared(of_kind[k].expected_px);
    common2 = std::min(common2, std::max(0.0, beyond));
    is_alone = false;
  }
  const double all = of_kind[device].median_px;
  return is_alone ? all : std::sqrt(squared(all) - common2);
}

}  // namespace

std::optional<std::size_t> device_that_is_off(
    std::span<const CrossingDisagreement> device_crossings) {
  const auto ratio = [](const CrossingDisagreement& d) {
    return d.crossings < kEnoughCrossings ? 0 : over_noise(d.median_px, d);
  };
  const auto most =
      std::max_element(device_crossings.begin(), device_crossings.end(),
                       [&](const auto& a, const auto& b) { return ratio(a) < ratio(b); });
  if (most == device_crossings.end() || !(ratio(*most) > kFarOverNoise)) return std::nullopt;
  return static_cast<std::size_t>(most - device_crossings.begin());
}

std::string misses_text(const Device& device, const CrossingDisagreement& crossings) {
  return "crossing lines of " + device.name + " miss each other by " +
         formatted(crossings.median_px, "%.2f px (median), ") +
         formatted(crossings.expected_px, "where image noise explains %.2f");
}

std::optional<Warning> device_warning(const Rig& rig,
                                      std::span<const CrossingDisagreement> device_crossings) {
  const std::optional<std::size_t> d = device_that_is_off(device_crossings);
  if (!d) return std::nullopt;
  const std::size_t cameras = rig.cameras.size();
  const bool is_camera = *d < cameras;
  const CrossingDisagreement& crossings = device_crossings[*d];
  const double own = is_camera ? own_miss(*d, device_crossings.first(cameras))
                               : own_miss(*d - cameras, device_crossings.subspan(cameras));
  if (over_noise(own, crossings) <= kFarOverNoise) return std::nullopt;
  const std::string& name = device_at(rig, *d).name;
  return Warning{WarningCode::kDeviceIsOff,
                 (is_camera ? "camera " : "projector ") + name +
                     ": crossing lines of it miss each other by " +
                     formatted(crossings.median_px, "%.2f") +
                     " projector pixels (median) where image noise explains " +
                     formatted(crossings.expected_px, "%.2f") +
                     ", more than those of any other device: it was moved or zoomed after the "
                     "calibration, or was calibrated badly; rig check --frames says by how much, "
                     "--refine-rig can correct it",
                 name,
                 {{"median_px", crossings.median_px}, {"expected_px", crossings.expected_px}}};
}

std::vector<Warning> missing_lines_warnings(const Rig& rig,
                                            std::span<const ExpectedLines> expected) {
  // Of 60 rigs drawn at random, right projectors have a third of the others' share and more; one
  // whose offset or pitch is another than the rig's has a tenth and less.
  constexpr double kHardly = 0.15;
  constexpr std::size_t kEnough = 2000;  // points that are expected; of few the share is chance
  const auto share = [](const ExpectedLines& lines) {
    return static_cast<double>(lines.named) / static_cast<double>(lines.points);
  };
  std::vector<Warning> warnings;
  for (std::size_t p = 0; p < expected.size(); ++p) {
    if (expected[p].points < kEnough) continue;
    std::vector<double> of_others;
    for (std::size_t k = 0; k < expected.size(); ++k)
      if (k != p && expected[k].points >= kEnough) of_others.push_back(share(expected[k]));
    if (of_others.empty()) continue;
    const double usual = upper_median(std::move(of_others));
    const double own = share(expected[p]);
    if (own >= kHardly * usual) continue;
    const std::string& name = rig.projectors[p].name;
    warnings.push_back(
        {WarningCode::kMissingLines,
         "projector " + name + ": of its lines that the measured surface lets expect, " +
             formatted(100 * own, "%.0f") + " % are in the pictures (of the others' " +
             formatted(100 * usual, "%.0f") +
             " %): it was off, is covered, is too dim beside the others, was turned away, or shows "
             "another pattern than the rig states",
         name,
         {{"share", own}, {"usual_share", usual}}});
  }
  return warnings;
}

std::optional<Warning> volume_warning(const Rig& rig, const CutLines& lines) {
  // As of a room around the volume (joint/piece_labels.cpp): rims of an object that fills it stay
  // below. A bunny and a ball with half and more of them outside: .30 each.
  constexpr double kMany = 0.1;
  if (lines.share() <= kMany) return std::nullopt;
  return Warning{WarningCode::kVolumeCuts,
                 "what was measured goes on beyond the volume, whose edge cuts " +
                     formatted(100 * lines.share(), "%.0f") +
                     " % of the lines in it: if that is the object, " +
                     (rig.volume ? "state a larger volume" : "state a volume that holds it") +
                     "; if it is what the object stands on, state \"floor\"",
                 {},
                 {{"share", lines.share()}}};
}

std::optional<Warning> few_names_warning(const PointResult& result) {
  // Another ring's rig, or one with two of the six cameras' names: .3 to 5.5 % (13 frames). Right
  // rigs: 70 % and more (492 frames of drawn and kept-apart rigs), and down to 3 % where one
  // projector's lines are 34 px apart.
  constexpr double kHardly = 0.1;
  std::size_t points = 0;
  for (const GridGraph& graph : result.graphs)
    for (const Curve& curve : graph.curves) points += curve.points.size();
  const auto named = static_cast<double>(labelled_points(result.labeling));
  if (points == 0 || named >= kHardly * static_cast<double>(points)) return std::nullopt;
  const double share = named / static_cast<double>(points);
  return Warning{WarningCode::kFewNames,
                 "only " + formatted(100 * share, "%.1f") +
                     " % of the lines in the pictures could be named: are these the pictures of "
                     "this rig's cameras, in the light of its projectors?",
                 {},
                 {{"share", share}}};
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
  return std::sqrt(light / kFullWell + squared(kRead));
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

Warning another_moment_warning(const Rig& rig, std::size_t camera, const ViewsApart& apart,
                               bool is_left_out) {
  const std::string& name = rig.cameras[camera].name;
  return {
      is_left_out ? WarningCode::kWrongPicture : WarningCode::kViewsDisagree,
      "camera " + name + ": what it sees lies apart from what the others see by " +
          formatted(*apart.with[camera], "%.1f") +
          " times as much as the pictures explain (the others' among each other by " +
          formatted(*apart.without[camera], "%.1f") +
          "): its picture is of another moment (a late trigger, a dropped picture)" +
          (is_left_out ? " or another camera's, or the camera was moved; reconstructed without it"
                       : ", or it stands a little elsewhere than the rig says"),
      name,
      {{"deviations", *apart.with[camera]}, {"deviations_among_others", *apart.without[camera]}}};
}

Warning views_warning(double deviations) {
  return {WarningCode::kViewsDisagree,
          "what the cameras see lies apart by " + formatted(deviations, "%.1f") +
              " times as much as their pictures explain: pictures of two cameras that see the "
              "projectors alike may be exchanged, a device was moved, or the object moved between "
              "the pictures",
          {},
          {{"deviations", deviations}}};
}

std::optional<Warning> depth_warning(double deviations, std::span<const Warning> said) {
  // Of 4,585 results of right rigs (drawn ones, films, artefacts, path tracers) the most is 2.43,
  // cameras of 12 megapixels have 2.4, and one very translucent object 2.76; of 24 with a device
  // that was knocked or a picture of another moment, the least is 2.71.
  constexpr double kLeastOfWrongRigs = 2.7;
  if (deviations < kLeastOfWrongRigs) return std::nullopt;
  // A camera that was left out no longer counts in depth.
  const auto explains = [](const Warning& warning) {
    return warning.code == WarningCode::kRigIsOff || warning.code == WarningCode::kViewsDisagree;
  };
  if (std::any_of(said.begin(), said.end(), explains)) return std::nullopt;
  return Warning{WarningCode::kViewsDisagree,
                 "depths that different cameras measured at one place lie apart by " +
                     formatted(deviations, "%.1f") +
                     " times as much as their light explains: the rig is a little off, paint or "
                     "relief on the object is as fine as the lines, light spreads below its "
                     "surface, or lines have wrong names",
                 {},
                 {{"deviations", deviations}}};
}

Warning motion_warning(const Rig& rig, const ExposureMotion& motion) {
  return {WarningCode::kMotion,
          "the object moved by " + formatted(motion.way) + " " + unit_name(rig) +
              ", give or take " + formatted(motion.way_deviation) +
              ", while the shutters were open, which blurs lines: the shape is that of the middle "
              "of the exposure; a shorter exposure is sharper",
          {},
          {{"way_mm", motion.way}, {"way_sigma_mm", motion.way_deviation}}};
}

}  // namespace pencilscan
