#include "pencilscan/pipeline/disagreement_warnings.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {

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
// Cameras of 640 x 480 have half as many, and one that turned keeps fewer. The median of n of them
// varies as their root: 1.0 is the most of 146 such devices of right rigs.
constexpr std::size_t kFewCrossings = 50;
// One device that is off shares its misses with devices of the other kind, not with its own.
constexpr double kMoreThanItsKind = 1.5;

// Noise is not all: an object whose light spreads makes the crossings of all devices miss. So one
// that stands out from its kind is off where it misses less, too. Of 1,643 results of drawn rigs,
// artefacts, films, a path tracer and foreign objects, right devices that miss more than noise
// explains miss 1.6 times as far as the next of their kind (a fence of wires as thin as
// lines: 3.3); cameras that turned by 1 px 2.7 to 4.5 times, projectors that turned by half a line
// spacing 2 to 3 times.
constexpr double kOverNoise = 1.2;
constexpr double kFarMoreThanItsKind = 2;
constexpr std::size_t kFewestOfAKind = 3;  // of two, either may be right
// A device that is off shares its misses with those of the other kind that see its lines. Where one
// of these misses nearly as far, it may be that one.
constexpr double kNearlyAsFar = 1.3;

constexpr double kLeastExpectedPx = 0.05;

double over_noise(double miss_px, const CrossingDisagreement& d) {
  const double certain = std::sqrt(static_cast<double>(d.crossings) / kEnoughCrossings);
  return miss_px / std::max(kLeastExpectedPx, d.expected_px) * std::min(1.0, certain);
}

double over_noise(const CrossingDisagreement& d) {
  return d.crossings < kFewCrossings ? 0 : over_noise(d.median_px, d);
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

/// The one that misses most of some devices.
std::size_t farthest(std::span<const CrossingDisagreement> devices) {
  return static_cast<std::size_t>(
      std::max_element(devices.begin(), devices.end(),
                       [](const auto& a, const auto& b) { return over_noise(a) < over_noise(b); }) -
      devices.begin());
}

/// Whether one device alone misses far more than the others of its kind do.
bool one_stands_apart(std::span<const CrossingDisagreement> of_kind) {
  std::vector<double> misses;
  for (const CrossingDisagreement& crossings : of_kind)
    if (const double miss = over_noise(crossings); miss > 0) misses.push_back(miss);
  if (misses.size() < kFewestOfAKind) return false;
  std::sort(misses.rbegin(), misses.rend());
  return misses[0] > kOverNoise && misses[0] > kFarMoreThanItsKind * misses[1];
}

/// The one projector that has far fewer crossings than the others, and these miss far more, while
/// noise explains what the others miss: what has the names of other lines hardly crosses the rest.
/// Two signs, so that each may be weaker. Of 1,787 results (as above) those of five wrong rigs have
/// both and no right one.
std::optional<std::size_t> one_that_lacks_crossings(
    std::span<const CrossingDisagreement> of_projectors) {
  constexpr double kFarFewer = 0.5;
  const auto ratio = [&](std::size_t p) {
    return of_projectors[p].median_px / std::max(kLeastExpectedPx, of_projectors[p].expected_px);
  };
  std::vector<std::size_t> some;
  std::vector<std::size_t> counts;
  for (std::size_t p = 0; p < of_projectors.size(); ++p) {
    if (of_projectors[p].crossings < kFewCrossings) continue;
    some.push_back(p);
    counts.push_back(of_projectors[p].crossings);
  }
  if (some.size() < kFewestOfAKind) return std::nullopt;
  std::sort(some.begin(), some.end(),
            [&](std::size_t a, std::size_t b) { return ratio(a) > ratio(b); });
  const auto usual = static_cast<double>(upper_median(std::move(counts)));
  const bool misses = ratio(some[0]) > kOverNoise && ratio(some[1]) < 1 &&
                      ratio(some[0]) > kMoreThanItsKind * ratio(some[1]);
  if (!misses || static_cast<double>(of_projectors[some[0]].crossings) >= kFarFewer * usual)
    return std::nullopt;
  return some[0];
}

/// Which devices may be the one that is off, the likelier one first: the one that stands out from
/// its kind, and one of the other kind that misses nearly as far.
std::vector<std::size_t> devices_apart(std::span<const CrossingDisagreement> of_devices,
                                       std::size_t cameras) {
  if (of_devices.size() <= cameras || cameras == 0) return {};
  const auto of_cameras = of_devices.first(cameras);
  const auto of_projectors = of_devices.subspan(cameras);
  if (!one_stands_apart(of_cameras) && !one_stands_apart(of_projectors)) {
    const auto projector = one_that_lacks_crossings(of_projectors);
    return projector ? std::vector{cameras + *projector} : std::vector<std::size_t>{};
  }
  const std::size_t camera = farthest(of_cameras);
  const std::size_t projector = cameras + farthest(of_projectors);
  std::vector<std::size_t> either{camera, projector};
  const auto miss = [&](std::size_t d) { return over_noise(of_devices[d]); };
  if (miss(projector) > miss(camera)) std::swap(either[0], either[1]);
  if (miss(either[0]) > kNearlyAsFar * miss(either[1])) either.pop_back();
  return either;
}

/// The device that misses most of all, where that is far beyond noise and the others of its kind.
std::optional<std::size_t> device_far_off(std::span<const CrossingDisagreement> device_crossings,
                                          std::size_t cameras) {
  const std::optional<std::size_t> d = device_that_is_off(device_crossings);
  if (!d) return std::nullopt;
  const bool is_camera = *d < cameras;
  const auto of_kind =
      is_camera ? device_crossings.first(cameras) : device_crossings.subspan(cameras);
  const std::size_t in_kind = is_camera ? *d : *d - cameras;
  const CrossingDisagreement& crossings = device_crossings[*d];
  if (over_noise(own_miss(in_kind, of_kind), crossings) <= kFarOverNoise) return std::nullopt;
  for (std::size_t k = 0; k < of_kind.size(); ++k)
    if (k != in_kind && kMoreThanItsKind * over_noise(of_kind[k]) > over_noise(crossings))
      return std::nullopt;
  return d;
}

}  // namespace

std::optional<std::size_t> device_that_is_off(
    std::span<const CrossingDisagreement> device_crossings) {
  if (device_crossings.empty()) return std::nullopt;
  const std::size_t most = farthest(device_crossings);
  if (!(over_noise(device_crossings[most]) > kFarOverNoise)) return std::nullopt;
  return most;
}

std::string misses_text(const Device& device, const CrossingDisagreement& crossings) {
  return "crossing lines of " + device.name + " miss each other by " +
         formatted(crossings.median_px, "%.2f px (median), ") +
         formatted(crossings.expected_px, "where image noise explains %.2f");
}

std::optional<Warning> device_warning(const Rig& rig,
                                      std::span<const CrossingDisagreement> device_crossings) {
  const std::size_t cameras = rig.cameras.size();
  std::vector<std::size_t> off;
  if (const auto far = device_far_off(device_crossings, cameras))
    off = {*far};
  else
    off = devices_apart(device_crossings, cameras);
  if (off.empty()) return std::nullopt;
  const auto name = [&](std::size_t d) {
    return (d < cameras ? "camera " : "projector ") + device_at(rig, d).name;
  };
  const CrossingDisagreement& crossings = device_crossings[off[0]];
  return Warning{WarningCode::kDeviceIsOff,
                 name(off[0]) + ": crossing lines of it miss each other by " +
                     formatted(crossings.median_px, "%.2f") +
                     " projector pixels (median) where image noise explains " +
                     formatted(crossings.expected_px, "%.2f") +
                     ", more than those of any other of its kind: it" +
                     (off.size() > 1 ? " (or " + name(off[1]) + ", whose lines cross there, too)"
                                     : std::string()) +
                     " was moved or zoomed after the calibration, or was calibrated badly; rig "
                     "check --frames says by how much, --refine-rig can correct it",
                 device_at(rig, off[0]).name,
                 {{"median_px", crossings.median_px}, {"expected_px", crossings.expected_px}}};
}

Warning turned_warning(const Rig& rig, const TurnedCamera& turned) {
  const std::string& name = rig.cameras[turned.camera].name;
  return {WarningCode::kDeviceIsOff,
          "camera " + name + ": lines that the other cameras measured lie " +
              formatted(turned.median_px, "%.2f") +
              " px (median) beside its curves of their colours, " +
              formatted(turned.expected_px, "%.2f") + " px with its picture shifted by " +
              formatted(turned.shift_px, "%.1f") +
              " px: it was moved or zoomed after the calibration, or was calibrated badly, and its "
              "lines may be named wrong; rig check --frames says by how much, --refine-rig can "
              "correct it",
          name,
          {{"median_px", turned.median_px},
           {"expected_px", turned.expected_px},
           {"shift_px", turned.shift_px}}};
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

std::optional<Warning> depth_warning(const ConsistencyReport& depth,
                                     std::span<const Warning> said) {
  // Right rigs share .04 to .38 (21 rendered scenes and 11 path-traced pictures); pictures with
  // filled-in colours .13 to .98, JPEG on few places 1.05. Rigs whose devices are all turned by .2
  // px have 1.2 to 1.5 where pictures are no JPEG, .1 px .7.
  constexpr double kLeastShared = 1.1;
  // Of 4,585 results of right rigs (drawn ones, films, artefacts, path tracers) the most is 2.43,
  // cameras of 12 megapixels have 2.4, and one very translucent object 2.76; filled-in colours and
  // JPEG repeat noise, and make up to 3.6 of it.
  constexpr double kLeastOfPlaces = 2.7;
  const auto has_said = [&](WarningCode code) {
    return std::any_of(said.begin(), said.end(), [&](const Warning& w) { return w.code == code; });
  };
  // A camera that was left out no longer counts in depth.
  if (has_said(WarningCode::kRigIsOff) || has_said(WarningCode::kViewsDisagree) ||
      has_said(WarningCode::kGamma))
    return std::nullopt;
  if (depth.shared_scale.value_or(0) >= kLeastShared) {
    return Warning{WarningCode::kViewsDisagree,
                   "depths that different cameras measured lie apart the same way over whole "
                   "patches of the surface, by " +
                       formatted(*depth.shared_scale, "%.1f") +
                       " times as much as their light explains of one place: the rig is a little "
                       "off, or light spreads below the surface",
                   {},
                   {{"deviations", *depth.shared_scale}}};
  }
  if (depth.sigma_scale < kLeastOfPlaces || has_said(WarningCode::kColorsFilledIn))
    return std::nullopt;
  return Warning{WarningCode::kViewsDisagree,
                 "depths that different cameras measured at one place lie apart by " +
                     formatted(depth.sigma_scale, "%.1f") +
                     " times as much as their light explains, each place by itself: paint or "
                     "relief on the object is as fine as the lines, or lines have wrong names; "
                     "that all of the rig is off does not look so",
                 {},
                 {{"deviations", depth.sigma_scale}}};
}

void let_gamma_explain(std::vector<Warning>& warnings) {
  const auto is_gamma = [](const Warning& w) { return w.code == WarningCode::kGamma; };
  const auto gamma = std::find_if(warnings.begin(), warnings.end(), is_gamma);
  if (gamma == warnings.end()) return;
  std::rotate(warnings.begin(), gamma, gamma + 1);
  std::erase_if(warnings, [](const Warning& w) {
    return w.code == WarningCode::kViewsDisagree && w.device.empty();
  });
}

}  // namespace pencilscan
