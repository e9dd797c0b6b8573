#include "pencilscan/page/advice.h"

#include <array>
#include <map>

#include "pencilscan/core/formatted.h"
#include "pencilscan/io/frame_failure.h"
#include "pencilscan/report/labelled_share.h"

namespace pencilscan {
namespace {

using nlohmann::json;

struct Known {
  const char* about;
  const char* action;
};

/// What to do about warnings, by their code (core/warning.h).
constexpr std::array<Known, 23> kKnown = {{
    {"out-of-focus",
     "Focus the camera on the object, with the aperture at which it takes frames, and look for "
     "mist, fingerprints or something before its lens; then calibrate again, for focus moves the "
     "picture."},
    {"saturated",
     "Close the aperture or shorten the exposure until the brightest lines stay below "
     "full scale, and capture again."},
    {"no-picture",
     "Check that this camera was triggered and that its file lies in the frame's "
     "folder under the camera's name."},
    {"no-lines",
     "Check that the camera sees the object, that the projectors were on, and that there is light "
     "enough (exposure, aperture); compare its picture with the others below."},
    {"little-light",
     "Expose longer, open the aperture, or use brighter projectors; gain adds noise as well."},
    {"lines-too-close",
     "Join fewer pixels, take cameras of more pixels, or state a wider pitch in the rig."},
    {"colors-mix",
     "Give projectors whose lines overlap colours of different channels "
     "(blue/cyan against red/yellow), or state color_matrix in the rig."},
    {"gamma",
     "Switch the camera to linear values, or state the gamma in the rig (calibrate "
     "measures it from solid pictures)."},
    {"rig-is-off",
     "Run reconstruct with --refine-rig, or calibrate again if devices were "
     "moved."},
    {"device-is-off",
     "Run rig check with --frames: it says how far the device moved. Put it back, or run "
     "reconstruct with --refine-rig."},
    {"names-doubtful",
     "Run rig check with --frames on several frames: it says which device moved, or shows or sees "
     "something else than the rig states."},
    {"wrong-picture",
     "Look at its picture below. If it is the right one, the camera was moved or is out of focus: "
     "rig check with --frames says how far it moved; put it back, or run reconstruct with "
     "--refine-rig."},
    {"views-disagree",
     "Compare the cameras' pictures below with where the cameras stand; if they are right, check "
     "the calibration (rig check). Of paint or ribs as fine as the lines, denser lines tell more."},
    {"curves-only",
     "Look at the hole map of each camera below: it says what kept "
     "depth from being found between the curves."},
    {"not-closed", "Look at the mesh for gaps; more overlap between the cameras closes them."},
    {"little-measured", "More cameras and projectors around the object measure more of it."},
    {"volume-cuts",
     "Look at where the measured surface ends: if the object goes on there, state a larger volume "
     "in the rig; if that is what it stands on, state its floor."},
    {"floor-cuts",
     "Look at where the measured surface ends: if the object goes on there, state the floor lower; "
     "its normal must point to the object. Without a floor in the rig, the warning floor-found "
     "writes the one that is seen."},
    {"floor-found",
     "State the floor in the rig, as the warning writes it: it is then left out, and lines close "
     "to "
     "it are named by it."},
    {"missing-lines",
     "Look whether the projector shines, and whether its picture is the one that the rig states "
     "(pencilscan pattern writes it); of a camera, whether something covers it, or it was moved."},
    {"few-names",
     "Check that rig and pictures belong together: the rig's file, the names of its cameras, and "
     "what the projectors show."},
    {"motion", "Shorten the exposure, or flash the projectors for a part of it."},
    {"colors-filled-in", "Let the camera give raw pictures and state its mosaic in the rig."},
}};

double number_at(const json& object, const char* key) {
  if (!object.is_object()) return 0;
  const auto it = object.find(key);
  return it != object.end() && it->is_number() ? it->get<double>() : 0.0;
}

std::string word_at(const json& object, const char* key) {
  const bool has = object.is_object() && object.contains(key) && object[key].is_string();
  return has ? object[key].get<std::string>() : std::string();
}

const json& child(const json& object, const char* key) {
  static const json kNothing;
  if (!object.is_object()) return kNothing;
  const auto it = object.find(key);
  return it == object.end() ? kNothing : *it;
}

/// What to do about a warning, by the code of the finding that says the same; empty: unknown.
std::string action_for(const std::string& warning, const json& findings) {
  if (!findings.is_array()) return {};
  for (const json& finding : findings) {
    if (word_at(finding, "text") != warning) continue;
    const std::string code = word_at(finding, "code");
    for (const Known& known : kKnown) {
      if (code == known.about) return known.action;
    }
  }
  return {};
}

/// Surface that nobody measured, by reason, where it is more than a few percent.
void advise_holes(const json& area, std::vector<Advice>& advice) {
  if (!area.is_object()) return;
  double total = 0;
  for (const auto& [reason, mm2] : area.items()) total += mm2.is_number() ? mm2.get<double>() : 0;
  if (!(total > 0)) return;
  constexpr double kWorthSaying = 0.04;
  static const std::map<std::string, Known> kByReason = {
      {"no projector",
       {"of the surface lies in the shadow of all projectors, is turned away from them, or shows "
        "none of their light",
        "Add or move a projector, or turn the object, so that light reaches it."}},
      {"one projector",
       {"of the surface is lit by one projector only, whose lines did not fix the depth",
        "Let the light of two projectors overlap there."}},
      {"too compressed",
       {"of the surface shows lines closer together than the camera resolves",
        "Use a wider line pitch, a longer focal length or a camera that faces this part."}},
      {"ambiguous",
       {"of the surface is lit by several projectors, and yet no depth was accepted",
        "Fewer projectors on the same spot, or different colours for neighbours, make it clear."}},
      {"contradicted",
       {"of the surface got depths that other views prove wrong",
        "Check calibration (--refine-rig) and shiny or translucent material."}},
      {"saturated", {"of the surface is overexposed", "Lower exposure or gain and capture again."}},
      {"not seen", {"of the surface is seen by no camera", "Add a camera, or turn the object."}},
  };
  for (const auto& [reason, mm2] : area.items()) {
    std::string words = reason;
    for (char& c : words) c = c == '_' ? ' ' : c;
    const auto known = kByReason.find(words);
    const double share = mm2.is_number() ? mm2.get<double>() / total : 0;
    if (known == kByReason.end() || share < kWorthSaying) continue;
    advice.push_back({percent_text(share) + " " + known->second.about, known->second.action});
  }
}

void advise_undecided(const json& report, std::vector<Advice>& advice) {
  constexpr double kMuch = 0.25;
  const auto labelled = labelled_share(report);
  if (labelled && *labelled < 1 - kMuch) {
    advice.push_back(
        {percent_text(1 - *labelled) + " of the detected curve points got no line",
         "Switch the image layer to \"undecided\": it shows the reason of every piece. Many "
         "crossings from two or more projectors on each part of the surface help most."});
  }
}

}  // namespace

Advice advise_failure(const std::filesystem::path& folder) {
  const auto failure = read_failure(folder);
  if (!failure) {
    return {"its folder holds neither a result nor a failure.json",
            "Run the same reconstruct again: it makes what is not there."};
  }
  return {failure->reason, failure->is_passing
                               ? "Another time may do better: make room on the disk or in memory "
                                 "and run the same reconstruct again, which keeps what is done."
                               : ""};
}

std::vector<Advice> advise(const json& report) {
  std::vector<Advice> advice;
  const json& warnings = child(report, "warnings");
  if (warnings.is_array()) {
    for (const json& warning : warnings) {
      if (!warning.is_string()) continue;
      const auto text = warning.get<std::string>();
      advice.push_back({text, action_for(text, child(report, "findings"))});
    }
  }
  const json& surface = child(report, "surface");
  const double boundary = number_at(surface, "boundary_edges");
  if (boundary > 0) {
    advice.push_back({"The mesh is not closed: it has " +
                          std::to_string(static_cast<long>(boundary)) + " boundary edges",
                      "Look for gaps at the rim of what the cameras see."});
  }
  advise_holes(child(surface, "area_mm2"), advice);
  advise_undecided(report, advice);
  return advice;
}

}  // namespace pencilscan
