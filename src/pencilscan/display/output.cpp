#include "pencilscan/display/output.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

bool overlap(const DisplayOutput& a, const DisplayOutput& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

void judge_mode(const OutputUse& use, std::vector<Fault>& faults) {
  const Projector& projector = *use.projector;
  const DisplayOutput& output = *use.output;
  const auto add = [&](const char* kind, const std::string& what, const std::string& advice) {
    faults.push_back({kind, projector.name, "output " + output.name + " " + what, advice});
  };
  const std::string sent = size_text(output.mode_width, output.mode_height);
  const std::string panel = size_text(projector.width, projector.height);
  if (output.mode_width != projector.width || output.mode_height != projector.height)
    add("size", "sends " + sent + " px, the projector of the rig has " + panel,
        "xrandr --output " + output.name + " --mode " + std::to_string(projector.width) + "x" +
            std::to_string(projector.height));
  const bool says_native = output.native_width > 0;
  if (says_native &&
      (output.native_width != output.mode_width || output.native_height != output.mode_height))
    add("not_native",
        "sends " + sent + " px to a display whose own size is " +
            size_text(output.native_width, output.native_height) + ": the display scales",
        "xrandr --output " + output.name + " --preferred, and the size in rig.json likewise");
  if (output.turned)
    add("turned", "is rotated or reflected",
        "xrandr --output " + output.name +
            " --rotate normal --reflect normal; a rolled projector "
            "is calibrated as it hangs");
  if (output.scaled)
    add("scaled", "is scaled by the graphics card",
        "xrandr --output " + output.name + " --transform none --scale 1x1");
  if (output.interlaced)
    add("interlaced", "sends every other row at a time", "choose a mode without \"i\"");
}

void judge_refresh(std::span<const OutputUse> uses, std::vector<Fault>& faults) {
  const OutputUse* first = nullptr;
  for (const OutputUse& use : uses) {
    if (!use.output->lit || use.output->refresh_hz <= 0) continue;
    if (first == nullptr) {
      first = &use;
      continue;
    }
    const double here = use.output->refresh_hz;
    const double there = first->output->refresh_hz;
    if (std::abs(here - there) <= kRefreshTolerance * there) continue;
    faults.push_back({"refresh", use.projector->name,
                      "output " + use.output->name + " refreshes at " + formatted(here, "%.2f Hz") +
                          ", that of " + first->projector->name + " at " +
                          formatted(there, "%.2f Hz") +
                          ": no exposure is a multiple of both periods",
                      "give all projectors the same refresh rate (xrandr --rate)"});
  }
}

}  // namespace

std::vector<Fault> output_faults(std::span<const OutputUse> uses,
                                 std::span<const DisplayOutput> outputs) {
  std::vector<Fault> faults;
  for (const OutputUse& use : uses) {
    const DisplayOutput& output = *use.output;
    if (!output.lit) {
      faults.push_back(
          {"no_signal", use.projector->name,
           "output " + output.name +
               (output.connected ? " is connected but switched off" : " has no display connected"),
           output.connected ? "xrandr --output " + output.name + " --auto"
                            : "check cable and power, then xrandr"});
      continue;
    }
    judge_mode(use, faults);
    for (const DisplayOutput& other : outputs) {
      if (other.name == output.name || !other.lit || !overlap(output, other)) continue;
      faults.push_back(
          {"mirrored", use.projector->name,
           "outputs " + output.name + " and " + other.name + " show the same part of the desktop",
           "xrandr --output " + output.name + " --right-of " + other.name});
    }
  }
  judge_refresh(uses, faults);
  return faults;
}

std::vector<OutputUse> uses_of(const Rig& rig, std::span<const DisplayOutput> outputs,
                               const std::map<std::string, std::string>& named,
                               const std::string& source, const std::string& lab) {
  std::string names;
  for (const DisplayOutput& output : outputs)
    if (output.connected) add_name(names, output.name);
  const std::string there = "; connected are: " + (names.empty() ? "none" : names);
  /// What is wrong with an output that `named` gives a projector, where that stands.
  const auto fault_of_named = [&](const std::string& projector, const std::string& output,
                                  const std::string& rule) {
    return lab.empty() ? InputError("command line", "--output", projector + "=" + output, rule)
                       : InputError(lab, "projectors." + projector + ".output", output, rule);
  };
  for (const auto& [projector, output] : named) {
    if (std::none_of(rig.projectors.begin(), rig.projectors.end(),
                     [&](const Projector& p) { return p.name == projector; }))
      throw fault_of_named(projector, output, "must be of a projector of " + source);
  }
  std::vector<OutputUse> uses;
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    const Projector& projector = rig.projectors[p];
    const auto own = named.find(projector.name);
    const std::string name = own == named.end() ? projector.output : own->second;
    const auto fault = [&](const std::string& rule) {
      return own == named.end()
                 ? InputError(source, "projectors[" + std::to_string(p) + "].output", name, rule)
                 : fault_of_named(projector.name, name, rule);
    };
    if (name.empty())
      throw fault("this key is missing (or " +
                  (lab.empty() ? "give --output " + projector.name + "=NAME)"
                               : "state projectors." + projector.name + ".output in " + lab + ")") +
                  there);
    const auto found = std::find_if(outputs.begin(), outputs.end(),
                                    [&](const DisplayOutput& o) { return o.name == name; });
    if (found == outputs.end()) throw fault("this computer has no such output" + there);
    for (const OutputUse& use : uses)
      if (use.output->name == name)
        throw fault("is the output of " + use.projector->name + ", too");
    uses.push_back({&projector, &*found});
  }
  return uses;
}

}  // namespace pencilscan
