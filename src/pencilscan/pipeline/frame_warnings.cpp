#include "pencilscan/pipeline/frame_warnings.h"

#include <string>
#include <utility>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"

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

namespace {

/// A camera has far less below this share of the others' median. One that stands elsewhere by 10 to
/// 80 px has .42 and less of the others' share of what was named, and of what the surface lets
/// expect; right ones have .77 and more of one of them (122 cameras of 32 scenes), but for one that
/// sees a plate from its edge.
constexpr double kLess = 0.5;

/// Cameras of which the solution named far less than of the others.
std::vector<char> have_few_names(std::span<const TellingPoints> named) {
  std::vector<char> few(named.size(), 0);
  for (std::size_t c = 0; c < named.size(); ++c) {
    if (!named[c].are_enough()) continue;
    std::vector<double> of_others;
    for (std::size_t k = 0; k < named.size(); ++k)
      if (k != c && named[k].are_enough()) of_others.push_back(named[k].named_share());
    if (of_others.size() < 2) continue;  // of two cameras, either may be right
    few[c] = named[c].named_share() < kLess * upper_median(std::move(of_others)) ? 1 : 0;
  }
  return few;
}

/// A device most of whose lines are missing, and what it has of the others'.
struct MissingLines {
  std::size_t device = 0;
  double share = 0;
  double usual = 0;
  bool is_next_to_all = false;
};

/// The devices of a kind that have less than half of what is usual.
std::vector<MissingLines> missing_lines(std::span<const ExpectedLines> expected) {
  // Of 60 rigs drawn at random, right projectors have a third of the others' share and more; one
  // whose offset or pitch is another than the rig's has a tenth and less.
  constexpr double kHardly = 0.15;
  constexpr double kLeastOfRight = 1.0 / 3;
  // Points of one curve are seen or not together: 22 in the mean before a bunny at 640x480. Of n
  // curves of which none is seen, less than 3 / n are to be seen, with 95 %.
  constexpr double kUnseenPoints = 3 * 22;
  constexpr std::size_t kEnough = 600;  // points that are expected, for a share known to a tenth
  const auto share = [](const ExpectedLines& lines) {
    return static_cast<double>(lines.named) / static_cast<double>(lines.points);
  };
  std::vector<MissingLines> missing;
  for (std::size_t d = 0; d < expected.size(); ++d) {
    if (expected[d].points == 0) continue;
    std::vector<double> of_others;
    for (std::size_t k = 0; k < expected.size(); ++k)
      if (k != d && expected[k].points >= kEnough) of_others.push_back(share(expected[k]));
    if (of_others.empty()) continue;
    const double usual = upper_median(std::move(of_others));
    const double own = share(expected[d]);
    const double most = own + kUnseenPoints / static_cast<double>(expected[d].points);
    const bool is_next_to_all = own < kHardly * usual && most < kLeastOfRight * usual;
    if (is_next_to_all || (expected[d].points >= kEnough && own < kLess * usual))
      missing.push_back({d, own, usual, is_next_to_all});
  }
  return missing;
}

}  // namespace

std::vector<Warning> missing_lines_warnings(const Rig& rig,
                                            std::span<const std::vector<ExpectedLines>> expected,
                                            std::span<const TellingPoints> named) {
  std::vector<ExpectedLines> of_cameras(rig.cameras.size());
  std::vector<ExpectedLines> of_projectors(rig.projectors.size());
  for (std::size_t c = 0; c < expected.size(); ++c) {
    for (std::size_t p = 0; p < expected[c].size(); ++p) {
      of_cameras[c].add(expected[c][p]);
      of_projectors[p].add(expected[c][p]);
    }
  }
  std::vector<Warning> warnings;
  const auto warn = [&](const std::string& kind, const std::string& name, const MissingLines& lines,
                        const std::string& where, const std::string& why) {
    warnings.push_back(
        {WarningCode::kMissingLines,
         kind + " " + name + ": of its lines that the measured surface lets expect, " +
             formatted(100 * lines.share, "%.0f") + " % are in " + where + " (of the others' " +
             formatted(100 * lines.usual, "%.0f") + " %): " + why,
         name,
         {{"share", lines.share}, {"usual_share", lines.usual}}});
  };
  const std::vector<char> few = have_few_names(named);
  for (const MissingLines& lines : missing_lines(of_cameras)) {
    const bool has_few = lines.device < few.size() && few[lines.device] != 0;
    if (!lines.is_next_to_all && !has_few) continue;
    warn("camera", rig.cameras[lines.device].name, lines, "its picture",
         "it is covered or was moved");
  }
  for (const MissingLines& lines : missing_lines(of_projectors)) {
    if (!lines.is_next_to_all) continue;
    warn("projector", rig.projectors[lines.device].name, lines, "the pictures",
         "it was off, is covered, is too dim beside the others, was turned away, or shows another "
         "pattern than the rig states");
  }
  return warnings;
}

std::optional<Warning> volume_warning(const Rig& rig, const CutLines& lines) {
  if (!lines.are_many()) return std::nullopt;
  return Warning{WarningCode::kVolumeCuts,
                 "what was measured goes on beyond the volume, whose edge cuts " +
                     formatted(100 * lines.share(), "%.0f") +
                     " % of the lines in it: if that is the object, " +
                     (rig.volume ? "state a larger volume" : "state a volume that holds it") +
                     "; if it is what the object stands on, state \"floor\"",
                 {},
                 {{"share", lines.share()}}};
}

std::optional<Warning> floor_cut_warning(const Rig& rig, const CutLines& lines) {
  if (!rig.floor || !lines.are_many_below()) return std::nullopt;
  return Warning{WarningCode::kFloorCuts,
                 "what was measured goes on below the floor that the rig states, which cuts " +
                     formatted(100 * lines.share_below(), "%.0f") +
                     " % of the lines above it: the floor is lower, or its normal points away from "
                     "the object; what lies below was left out",
                 {},
                 {{"share", lines.share_below()}}};
}

Warning floor_warning(const FoundFloor& found) {
  const auto [point, normal] = found.floor;
  const auto list = [](const Vec3& x, const char* format) {
    return "[" + formatted(x.x(), format) + ", " + formatted(x.y(), format) + ", " +
           formatted(x.z(), format) + "]";
  };
  return {
      WarningCode::kFloorFound,
      "the object stands on a plane that goes on beyond it, with " +
          formatted(100 * found.share, "%.0f") +
          " % of what could be named: its lines were named as lines on it, and it is measured as "
          "the object is; to leave it out, state \"floor\": {\"point\": " +
          list(point, "%.6g") + ", \"normal\": " + list(normal, "%.6f") + "}",
      {},
      {{"share", found.share},
       {"sides", found.sides},
       {"floor_x", point.x()},
       {"floor_y", point.y()},
       {"floor_z", point.z()},
       {"normal_x", normal.x()},
       {"normal_y", normal.y()},
       {"normal_z", normal.z()}}};
}

double share_of_named_points(std::span<const GridGraph> graphs, const Labeling& labeling) {
  std::size_t points = 0;
  for (const GridGraph& graph : graphs) points += curve_points(graph);
  return points == 0 ? 1
                     : static_cast<double>(labelled_points(labeling)) / static_cast<double>(points);
}

bool deny_rig(const CrossingDisagreement& crossings, double share_of_named_points) {
  return disagrees(crossings) && share_of_named_points >= kHardlyNamed;
}

std::optional<Warning> few_names_warning(const PointResult& result) {
  const double share = share_of_named_points(result.graphs, result.labeling);
  if (share >= kHardlyNamed) return std::nullopt;
  return Warning{WarningCode::kFewNames,
                 "only " + formatted(100 * share, "%.1f") +
                     " % of the lines in the pictures could be named: are these the pictures of "
                     "this rig's cameras, in the light of its projectors?",
                 {},
                 {{"share", share}}};
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
