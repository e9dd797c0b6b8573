#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "pencilscan/pipeline/disagreement_warnings.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/light_warnings.h"
#include "pencilscan/pipeline/line_contrast.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/lost_cameras.h"
#include "pencilscan/pipeline/picture_check.h"

// Of a frame's way: what its pictures say of themselves, and the solution.

namespace pencilscan {
namespace {

/// Forgets what the cameras of the findings saw.
void leave_out(const Rig& rig, const std::vector<PictureFinding>& findings, PointResult& result) {
  for (const PictureFinding& finding : findings) {
    forget_camera(static_cast<std::size_t>(finding.camera), result);
    result.warnings.push_back(
        {WarningCode::kWrongPicture, describe(rig, finding), rig.camera(finding.camera).name});
  }
}

/// True where the rig is right although many curves have no name. Two signs say so, each by itself:
///   1. points that one camera measured lie on the lines of the others,
///   2. guided matching names most curves from the surface around them.
bool is_right_rig(const Rig& rig, const PointOptions& options, const PointResult& result) {
  if (points_lie_on_lines(rig, result)) return true;
  std::vector<GridGraph> graphs = result.graphs;
  Labeling labeling = result.labeling;
  match_guided(rig, result.families, presence_images(result.detections), graphs, labeling,
               options.guided);
  return least_named_share(labeling) > kMostNamed;
}

/// Gives the curves their lines. Methods that correct the rig first leave out pictures that do not
/// fit, and give back the rig that the lines were named with where it is not the one given.
std::optional<Rig> label_lines(const Rig& rig, const Frame& frame, const PointOptions& options,
                               PointResult& result) {
  const SolutionMethod& method = solution_method(options.method);
  const auto solve = [&] {
    return method.solve(rig, result.families, result.graphs, options.method);
  };
  result.labeling = solve();
  if (!method.capabilities.corrects_rig) return std::nullopt;
  if (const auto pair = exchanged_projectors(rig, frame, result, options)) {
    const std::string one = rig.projector(pair->first).name;
    const std::string other = rig.projector(pair->second).name;
    throw ProjectorsExchanged(
        "projectors " + one + " and " + other +
        " show each other's patterns: their outputs or cables are exchanged (put them "
        "back; frames that are taken already fit a rig with the two patterns exchanged)");
  }
  std::vector<PictureFinding> misplaced = misplaced_pictures(rig, frame, result, options);
  if (misplaced.empty()) misplaced = contradicting_pictures(rig, frame, result, options);
  if (!misplaced.empty()) {
    leave_out(rig, misplaced, result);
    result.labeling = solve();
  }
  LineNaming naming = name_lines(rig, result.families, result.graphs, result.labeling, options,
                                 [&] { return is_right_rig(rig, options, result); });
  result.labeling = std::move(naming.labeling);
  result.crossings = naming.crossings;
  result.device_crossings = std::move(naming.device_crossings);
  result.rig_in_frame = naming.rig_in_frame;
  if (naming.color_warning) result.warnings.push_back(std::move(*naming.color_warning));
  if (naming.warning) {
    result.warnings.push_back(std::move(*naming.warning));
  } else if (share_of_named_points(result.graphs, result.labeling) < kHardlyNamed) {
    // What few names say of devices may be names' fault.
  } else if (std::optional<Warning> warning = device_warning(rig, result.device_crossings)) {
    result.warnings.push_back(std::move(*warning));
  } else if (const auto turned = turned_camera(rig, result.families, result.graphs, result.labeling,
                                               result.device_crossings)) {
    result.warnings.push_back(turned_warning(rig, *turned));
  }
  return std::move(naming.corrected);
}

/// Names lines once more where they show a floor that the rig does not state: as if it did. Nothing
/// is left out for it, since it may be what a user wants; only names of lines that a period moves
/// off it are less likely than those on it.
void label_with_floor(const Rig& rig, const PointOptions& options, PointResult& result) {
  const SolutionMethod& method = solution_method(options.method);
  if (rig.floor || !method.capabilities.corrects_rig || result.corrected) return;
  result.floor = find_floor(rig, named_places(rig, result.graphs, result.labeling));
  if (!result.floor) return;
  Rig with_floor = rig;
  with_floor.floor = result.floor->floor;
  result.labeling = method.solve(with_floor, result.families, result.graphs, options.method);
}

}  // namespace

void forget_camera(std::size_t camera, PointResult& result) {
  result.left_out[camera] = 1;
  result.detections[camera] = {};
  result.graphs[camera] = {};
  result.graphs[camera].camera = static_cast<int>(camera);
  const auto clear = [camera](auto& per_camera) {
    if (camera < per_camera.size()) per_camera[camera].clear();
  };
  clear(result.labeling.runs);
  clear(result.labeling.tentative);
  clear(result.labeling.undecided);
  clear(result.labeling.denied);
  if (camera < result.device_crossings.size()) result.device_crossings[camera] = {};
}

PointResult check_pictures(const Rig& rig, const Frame& frame, PointResult curves) {
  if (std::optional<Warning> warning = interpolation_warning(rig, curves.detections))
    curves.warnings.push_back(std::move(*warning));
  const auto gammas = gammas_of_light(rig, frame, curves.graphs);
  if (std::optional<Warning> warning = gamma_warning(rig, gammas))
    curves.warnings.push_back(std::move(*warning));
  else if (std::string note = gamma_note(rig, frame, gammas); !note.empty())
    curves.notes.push_back(std::move(note));
  leave_out(rig, plain_faults(rig, frame), curves);
  for (Warning& warning : focus_warnings(rig, frame, curves))
    curves.warnings.push_back(std::move(warning));
  return curves;
}

PointResult solve_frame(const Rig& rig, const Frame& frame, PointResult curves,
                        const PointOptions& options, const StageClock& clock) {
  PointResult result = std::move(curves);
  clock("solution", [&] {
    result.corrected = label_lines(rig, frame, options, result);
    label_with_floor(rig, options, result);
  });
  return result;
}

}  // namespace pencilscan
