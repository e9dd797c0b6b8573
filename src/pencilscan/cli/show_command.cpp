#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/interruption.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/display/projector_picture.h"
#include "pencilscan/display/projector_windows.h"
#include "pencilscan/rig/devices_file.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kCheckInterval = 2;  ///< s between looks at what is really shown

struct ShowOptions {
  CommonOptions common;
  std::string rig_path;
  std::string what = "lines";
  std::vector<std::string> outputs;     ///< proj0=HDMI-1
  std::vector<std::string> projectors;  ///< the only ones to show it; others stay black
  std::string assign_to;
  double seconds = 0;  ///< 0: until stopped
  bool list = false;
  bool overwrite = false;
};

Json describe(const DisplayOutput& output) {
  Json json;
  json["monitor"] = output.monitor;
  json["connected"] = output.connected;
  json["lit"] = output.lit;
  if (!output.lit) return json;
  json["mode"] = std::to_string(output.mode_width) + "x" + std::to_string(output.mode_height);
  if (output.native_width > 0)
    json["native"] =
        std::to_string(output.native_width) + "x" + std::to_string(output.native_height);
  json["refresh_hz"] = output.refresh_hz;
  json["place"] = std::to_string(output.x) + "," + std::to_string(output.y);
  if (output.turned) json["turned"] = true;
  if (output.scaled) json["scaled"] = true;
  if (output.interlaced) json["interlaced"] = true;
  return json;
}

void list_outputs(const ShowOptions& options) {
  XScreen screen;
  Json figures;
  for (const DisplayOutput& output : screen.outputs()) {
    if (!output.connected && !output.lit) continue;
    figures[output.name] = describe(output);
    if (output.lit) figures[output.name]["altered_colors"] = screen.alters_colors(output);
  }
  if (figures.empty()) throw StageError("no display is connected to this computer");
  print_figures(options.common, figures);
}

std::map<std::string, std::string> named_outputs(const ShowOptions& options) {
  std::map<std::string, std::string> named;
  for (const std::string& text : options.outputs) {
    const auto sign = text.find('=');
    if (sign == std::string::npos || sign == 0 || sign + 1 == text.size())
      throw InputError("command line", "--output", text, "must be PROJECTOR=OUTPUT");
    named[text.substr(0, sign)] = text.substr(sign + 1);
  }
  return named;
}

/// The number, from 1 to `count`, that a projector shows, or nothing; none of `taken`, to which it
/// is added. Asks until there is one: a wrong key shall not cost the answers before.
std::string answer_for(const std::string& projector, std::size_t count,
                       std::set<std::string>& taken) {
  for (;;) {
    std::cerr << "The number that " << projector << " shows (Enter: none): " << std::flush;
    std::string answer;
    if (!std::getline(std::cin, answer)) throw StageError("no answer on the standard input");
    if (answer.empty()) return answer;
    bool shown = false;
    for (std::size_t i = 1; i <= count; ++i) shown = shown || answer == std::to_string(i);
    if (shown && taken.insert(answer).second) return answer;
    std::cerr << (shown ? answer + " is another projector's"
                        : "numbers from 1 to " + std::to_string(count) + " are shown")
              << "; once more\n";
  }
}

/// Every lit output shows its number; the terminal asks which projector that is.
void assign(const ShowOptions& options) {
  refuse_existing("--assign", options.assign_to, options.overwrite);
  UncalibratedRig devices = read_devices(options.rig_path);
  const auto outputs = XScreen().outputs();
  std::vector<Projector> labels;
  for (const DisplayOutput& output : outputs) {
    if (!output.lit) continue;
    Projector label;
    label.name = std::to_string(labels.size() + 1);
    label.output = output.name;
    label.width = output.mode_width;
    label.height = output.mode_height;
    labels.push_back(label);
  }
  std::vector<OutputUse> uses;
  for (const Projector& label : labels)
    for (const DisplayOutput& output : outputs)
      if (output.name == label.output) uses.push_back({&label, &output});
  ProjectorWindows windows(uses);
  for (std::size_t i = 0; i < labels.size(); ++i)
    windows.show(i, render_picture({ProjectorPicture::Kind::kIdentify, 0, {}}, labels[i]));
  Json figures;
  std::set<std::string> taken;
  for (Projector& projector : devices.rig.projectors) {
    const std::string answer = answer_for(projector.name, labels.size(), taken);
    projector.output = answer.empty() ? "" : labels[std::stoul(answer) - 1].output;
    figures[projector.name] = projector.output;
  }
  write_devices(devices, options.assign_to);
  print_figures(options.common, figures);
}

/// Faults once each, as they appear.
void report_new(const std::vector<Fault>& faults, std::set<std::string>& known) {
  for (const Fault& fault : faults) {
    if (!known.insert(to_string(fault)).second) continue;
    std::cerr << to_string(fault) << "\n";
    if (!fault.advice.empty()) std::cerr << "  what to do: " << fault.advice << "\n";
  }
}

void run_show(const ShowOptions& options) {
  Interruption interruption;  // before any thread
  if (options.list) return list_outputs(options);
  if (options.rig_path.empty())
    throw InputError("command line", "--rig", "", "is required, but for --list");
  if (!options.assign_to.empty()) return assign(options);
  const auto picture = picture_from_text(options.what);
  if (!picture)
    throw InputError("command line", "--what", options.what,
                     "must be lines, black, white, red, green, blue, grey25, grey50, grey75, "
                     "gray:N, identify, columns, rows or focus");
  Rig rig = read_devices(options.rig_path).rig;
  const auto outputs = XScreen().outputs();
  const auto uses = uses_of(rig, outputs, named_outputs(options), options.rig_path);
  for (std::size_t p = 0; p < uses.size(); ++p) rig.projectors[p].output = uses[p].output->name;
  const std::set<std::string> chosen(options.projectors.begin(), options.projectors.end());
  for (const std::string& name : chosen)
    if (std::none_of(uses.begin(), uses.end(),
                     [&](const OutputUse& use) { return use.projector->name == name; }))
      throw InputError("command line", "--projector", name,
                       "must be a projector of " + options.rig_path);
  std::vector<cv::Mat> pictures;
  for (const Projector& projector : rig.projectors) {
    const bool shows = chosen.empty() || chosen.contains(projector.name);
    pictures.push_back(
        render_picture(shows ? *picture : ProjectorPicture{}, projector, options.rig_path));
  }
  ProjectorWindows windows(uses);
  for (std::size_t p = 0; p < pictures.size(); ++p) windows.show(p, pictures[p]);
  std::cerr << "pencilscan: showing " << to_string(*picture) << "; Ctrl-C, Escape or q stops\n";
  std::set<std::string> known;
  const Stopwatch watch;
  auto faults = windows.check();
  report_new(faults, known);
  double checked = watch.seconds();
  while (!windows.dismissed() && !interruption.within(0.1)) {
    if (options.seconds > 0 && watch.seconds() >= options.seconds) break;
    if (watch.seconds() - checked < kCheckInterval) continue;
    faults = windows.check();
    report_new(faults, known);
    checked = watch.seconds();
  }
  faults = windows.check();
  report_new(faults, known);
  Json figures;
  for (std::size_t p = 0; p < uses.size(); ++p) {
    Json& entry = figures[rig.projectors[p].name];
    entry["output"] = uses[p].output->name;
    entry["refresh_hz"] = uses[p].output->refresh_hz;
    entry["pixels_as_drawn"] = std::none_of(faults.begin(), faults.end(), [&](const Fault& fault) {
      return fault.device == rig.projectors[p].name;
    });
  }
  print_figures(options.common, figures);
  if (!faults.empty()) {
    std::cout.flush();
    throw StageError(to_string(faults.front()));
  }
}

}  // namespace

void add_show_command(CLI::App& app) {
  auto options = std::make_shared<ShowOptions>();
  CLI::App* command = app.add_subcommand(
      "show", "Show every projector's picture on its output, pixel by pixel (Ctrl-C stops)");
  command->add_option("--rig", options->rig_path,
                      "The rig (rig.json); its projectors name their \"output\"");
  CLI::Option* what =
      command
          ->add_option("--what", options->what,
                       "lines, black, white, red, green, blue, grey25, grey50, grey75, gray:N "
                       "(image N of the Gray codes), identify, columns, rows, focus")
          ->capture_default_str();
  command->add_option("--output", options->outputs,
                      "PROJECTOR=OUTPUT instead of the rig's: proj0=HDMI-1");
  command->add_option("--projector", options->projectors,
                      "Only this projector shows it, the others are black; repeat for more");
  command->add_option("--seconds", options->seconds, "Stop after this time")->check(above_zero());
  CLI::Option* list =
      command->add_flag("--list", options->list, "List the outputs of this computer instead");
  CLI::Option* assign =
      command
          ->add_option("--assign", options->assign_to,
                       "Ask which projector shows which number, and write the rig with its outputs "
                       "to this file")
          ->check(only_where(
              [options, what] { return what->count() == 0 || options->what == "identify"; },
              "needs --what identify"));
  add_overwrite(*command, options->overwrite, "With --assign: replace a file that is there",
                assign);
  excludes_all_but(*command, *assign, {"--rig", "--what", "--overwrite"});
  excludes_all_but(*command, *list, {});
  add_common_options(*command, options->common, "pencilscan show --rig rig.json --what identify");
  command->callback([options] { run_show(*options); });
}

}  // namespace pencilscan::cli
