#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/rig_files.h"
#include "pencilscan/cli/rig_fit_command.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/planning/rig_check.h"
#include "pencilscan/planning/ring.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegree = std::numbers::pi / 180;

// ---- pencilscan rig ring ------------------------------------------------------------------------

struct RingCommand {
  CommonOptions common;
  RingOptions ring;
  std::string out;
  bool overwrite = false;
  double arc_deg = 360;
  double camera_elevation_deg = 15;
  double vertical_elevation_deg = 8;
  double horizontal_elevation_deg = 34;
  std::vector<std::string> lines{"vertical", "horizontal"};
  std::vector<std::string> colors{"blue,cyan", "red,yellow"};
  std::vector<double> rolls_deg{0};
};

/// "red,green,blue" as the colours of a pattern.
std::vector<PatternColor> color_list(const std::string& text) {
  std::vector<PatternColor> names;
  std::istringstream words(text);
  for (std::string name; std::getline(words, name, ',');) {
    if (!color_from_name(name)) {
      throw InputError("command line", "--colors", name,
                       "must be blue, cyan, red, yellow, green, magenta or white, with commas");
    }
    names.emplace_back(name);
  }
  return names;
}

/// What goes round the projectors.
void set_patterns(const RingCommand& command, RingOptions& ring) {
  constexpr double kLongestCode = 1 << 20;  // symbols, as rig.json takes them
  ring.axes.clear();
  ring.colors.clear();
  ring.rolls_rad.clear();
  for (const std::string& lines : command.lines)
    ring.axes.push_back(lines == "vertical" ? Axis::kColumn : Axis::kRow);
  for (const std::string& colors : command.colors) {
    ring.colors.push_back(color_list(colors));
    if (std::pow(ring.colors.back().size(), ring.order) > kLongestCode) {
      throw InputError("command line", "--order", std::to_string(ring.order),
                       "colours^order must be <= 2^20");
    }
  }
  for (const double roll : command.rolls_deg) ring.rolls_rad.push_back(roll * kDegree);
}

/// Of what goes round the projectors and was given for more of them than there are.
template <class Value>
void warn_of_left_over(const std::string& option, const std::vector<Value>& values,
                       const std::vector<Value>& of_default, int projectors) {
  const auto used = static_cast<std::size_t>(projectors);
  if (values.size() <= used || values == of_default) return;
  warn_of(option + ": " + std::to_string(values.size()) + " values for " + std::to_string(used) +
          " projectors, those after them have no effect");
}

/// Whether a projector has such lines.
bool has_lines(const RingCommand& command, const char* which) {
  const std::size_t used =
      std::min(command.lines.size(), static_cast<std::size_t>(command.ring.projectors));
  const auto end = command.lines.begin() + static_cast<std::ptrdiff_t>(used);
  return std::find(command.lines.begin(), end, which) != end;
}

void run_ring(RingCommand command) {
  const ThreadLimit threads(command.common.threads);
  RingOptions& ring = command.ring;
  const auto require = [](bool holds, const char* option, double value, const char* rule) {
    if (!holds) throw InputError("command line", option, Json(value).dump(), rule);
  };
  require(ring.volume_radius_mm < ring.distance_mm, "--distance-mm", ring.distance_mm,
          "must be larger than --volume-radius-mm");
  require(ring.line_width_px <= ring.pitch_px, "--line-width-px", ring.line_width_px,
          "must be <= --pitch-px");
  require(ring.offset_px <= std::min(ring.projector_width, ring.projector_height) - 0.5,
          "--offset-px", ring.offset_px, "the first line must lie on the panel");
  refuse_existing("--out", command.out, command.overwrite);
  ring.arc_rad = std::min(command.arc_deg * kDegree, 2 * std::numbers::pi);
  ring.camera_elevation_rad = command.camera_elevation_deg * kDegree;
  ring.vertical_elevation_rad = command.vertical_elevation_deg * kDegree;
  ring.horizontal_elevation_rad = command.horizontal_elevation_deg * kDegree;
  set_patterns(command, ring);
  warn_of_left_over("--lines", command.lines, RingCommand().lines, ring.projectors);
  warn_of_left_over("--colors", command.colors, RingCommand().colors, ring.projectors);
  warn_of_left_over("--roll-deg", command.rolls_deg, RingCommand().rolls_deg, ring.projectors);
  write_rig(make_ring(ring), command.out);
  print_figures(command.common, {{"rig", command.out},
                                 {"cameras", ring.cameras},
                                 {"projectors", ring.projectors},
                                 {"distance_mm", ring.distance_mm},
                                 {"pitch_px", ring.pitch_px}});
}

void add_ring(CLI::App& group) {
  auto options = std::make_shared<RingCommand>();
  CLI::App* command = group.add_subcommand("ring", "Write a ring of cameras and projectors");
  RingOptions& ring = options->ring;
  command->add_option("--out", options->out, "The rig file to write (rig.json)")->required();
  add_overwrite(*command, options->overwrite, "Replace a rig file that is there");
  add_number(*command, "--cameras", ring.cameras, 1, 256, "Number of cameras");
  add_number(*command, "--projectors", ring.projectors, 1, 256, "Number of projectors");
  add_number(*command, "--distance-mm", ring.distance_mm, 1, 1e6,
             "Distance of the devices to the centre");
  add_number(*command, "--volume-radius-mm", ring.volume_radius_mm, 0.1, 1e6,
             "Radius of the working volume");
  add_number(*command, "--arc-deg", options->arc_deg, 1, 360, "Part of the circle to use");
  add_number(*command, "--camera-elevation-deg", options->camera_elevation_deg, -80, 80, "Cameras");
  command->add_option("--lines", options->lines, "Lines of the projectors in turn")
      ->check(one_of({"vertical", "horizontal"}))
      ->capture_default_str();
  const auto of_lines = [options](const char* option, const char* which) {
    return told_where_not(
        option, [options, which] { return has_lines(*options, which); },
        std::string("needs a projector of ") + which + " lines");
  };
  add_number(*command, "--vertical-elevation-deg", options->vertical_elevation_deg, -80, 80,
             "Projectors of vertical lines")
      ->check(of_lines("--vertical-elevation-deg", "vertical"));
  add_number(*command, "--horizontal-elevation-deg", options->horizontal_elevation_deg, -80, 80,
             "Projectors of horizontal lines: about 30 degrees off the cameras")
      ->check(of_lines("--horizontal-elevation-deg", "horizontal"));
  add_number(*command, "--camera-width", ring.camera_width, 16, 65536, "px");
  add_number(*command, "--camera-height", ring.camera_height, 16, 65536, "px");
  add_number(*command, "--camera-focal-px", ring.camera_focal_px, 1, 1e6, "px");
  add_number(*command, "--projector-width", ring.projector_width, 16, 65536, "px");
  add_number(*command, "--projector-height", ring.projector_height, 16, 65536, "px");
  add_number(*command, "--projector-focal-px", ring.projector_focal_px, 1, 1e6, "px");
  add_number(*command, "--pitch-px", ring.pitch_px, 1, 1e4, "Distance of neighbouring lines");
  add_number(*command, "--line-width-px", ring.line_width_px, 0.1, 1e4, "Width of a line");
  add_number(*command, "--offset-px", ring.offset_px, -0.5, 1e5, "Centre of the first line");
  add_number(*command, "--order", ring.order, 1, 20,
             "Lines in a row whose colours tell where they are");
  command->add_option("--colors", options->colors, "Colours of the projectors in turn, with commas")
      ->capture_default_str();
  command
      ->add_option("--roll-deg", options->rolls_deg,
                   "Rolls of the projectors in turn: tilted lines")
      ->check(any_number<double>())
      ->capture_default_str();
  add_common_options(*command, options->common, "pencilscan rig ring --out rig.json");
  command->callback([options] { run_ring(*options); });
}

// ---- pencilscan rig check -----------------------------------------------------------------------

struct CheckCommand {
  CommonOptions common;
  std::string rig_path;
  RigFitCommand fit;
};

std::string family_name(const Rig& rig, const LineFamily& family) {
  const Projector& projector = rig.projectors[family.projector];
  if (projector.patterns.size() == 1) return projector.name;
  return projector.name + "/" + std::to_string(family.pattern);
}

Json to_json(const CoverageCheck& coverage) {
  return {{"seen", coverage.seen},
          {"lit", coverage.lit},
          {"seen_and_lit", coverage.seen_and_lit},
          {"usable", coverage.usable},
          {"grid", coverage.grid},
          {"skew_grid", coverage.skew_grid},
          {"two_views", coverage.two_views},
          {"ambiguous", coverage.ambiguous}};
}

Json to_json(const Rig& rig, const RigCheck& check) {
  const Vec3& center = check.volume.center;
  Json json;
  json["volume"] = {{"center", {center.x(), center.y(), center.z()}},
                    {"radius", check.volume.radius}};
  json["samples"] = check.samples;
  json["coverage"] = to_json(check.coverage);
  json["pairs"] = Json::array();
  for (const PairCheck& pair : check.pairs) {
    json["pairs"].push_back({{"camera", rig.cameras[pair.camera].name},
                             {"projector", rig.projectors[pair.family.projector].name},
                             {"pattern", pair.family.pattern},
                             {"shared_samples", pair.shared},
                             {"usable_share", pair.usable_share},
                             {"sensitive_share", pair.sensitive_share},
                             {"sensitivity_median", pair.sensitivity_median},
                             {"px_per_mm_median", pair.px_per_mm_median},
                             {"line_spacing_median_px", pair.spacing_median_px}});
  }
  json["axes"] = Json::array();
  for (const AxesCheck& axes : check.axes) {
    json["axes"].push_back({{"first", family_name(rig, axes.first)},
                            {"second", family_name(rig, axes.second)},
                            {"angle_deg", axes.angle_rad / kDegree},
                            {"distance_mm", axes.distance_mm},
                            {"skewness", axes.skewness},
                            {"same_color", axes.same_color},
                            {"shared_views", axes.shared},
                            {"crossing_share", axes.crossing_share},
                            {"parallel_share", axes.parallel_share}});
  }
  json["warnings"] = Json::array();
  for (const RigWarning& warning : check.warnings) {
    json["warnings"].push_back({{"severity", warning.severe ? "severe" : "warning"},
                                {"kind", warning.kind},
                                {"text", warning.text}});
  }
  return json;
}

constexpr const char* kPairLegend =
    "  shared    places of the volume that the camera sees and the projector lights\n"
    "  usable    of these, with depth s and lines px large enough to be measured\n"
    "  depth s   sensitivity: how far a line moves with depth; 0 tells nothing of depth\n"
    "  px/mm     projector pixels that a mm of depth moves the line\n"
    "  lines px  distance of neighbouring lines in the camera's image\n";
constexpr const char* kAxesLegend =
    "  axis      where all planes of a projector's lines meet, a line through the projector\n"
    "  skewness  0: the axes lie in one plane, and crossings tell little\n"
    "  crossing  of what shows both: usable, and crossing at a wide angle\n"
    "  parallel  of what shows both: nearly parallel in the image\n";

/// The bytes of a text that take `columns` columns: those that go on a character of UTF-8 take
/// none.
int width_of(const std::string& text, int columns) {
  return columns + static_cast<int>(std::count_if(text.begin(), text.end(), [](char c) {
           return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
         }));
}

void print_tables(const Rig& rig, const RigCheck& check) {
  std::printf("What each camera sees of each projector's lines\n");
  std::printf("%-10s %-12s %7s %7s %8s %8s %8s\n", "camera", "projector", "shared", "usable",
              "depth s", "px/mm", "lines px");
  for (const PairCheck& pair : check.pairs) {
    if (pair.shared == 0) continue;
    const std::string& camera = rig.cameras[pair.camera].name;
    const std::string family = family_name(rig, pair.family);
    std::printf("%-*s %-*s %7zu %6.0f%% %8.2f %8.2f %8.1f\n", width_of(camera, 10), camera.c_str(),
                width_of(family, 12), family.c_str(), pair.shared, 100 * pair.usable_share,
                pair.sensitivity_median, pair.px_per_mm_median, pair.spacing_median_px);
  }
  std::printf("%s", kPairLegend);
  std::printf("\nHow the lines of two projectors meet in the images\n");
  std::printf("%-12s %-12s %8s %8s %8s %9s %9s\n", "axis", "axis", "angle", "mm apart", "skewness",
              "crossing", "parallel");
  for (const AxesCheck& axes : check.axes) {
    if (axes.shared == 0) continue;
    const std::string first = family_name(rig, axes.first);
    const std::string second = family_name(rig, axes.second);
    std::printf("%-*s %-*s %7.1f\u00b0 %8.0f %8.3f %8.0f%% %8.0f%%%s\n", width_of(first, 12),
                first.c_str(), width_of(second, 12), second.c_str(), axes.angle_rad / kDegree,
                axes.distance_mm, axes.skewness, 100 * axes.crossing_share,
                100 * axes.parallel_share, axes.same_color ? "  same colour" : "");
  }
  std::printf("%s\n", kAxesLegend);
  std::fflush(stdout);
}

/// Shares of the volume, each with what it means.
void print_coverage(const CoverageCheck& coverage) {
  const auto row = [](const char* name, double share, const char* meaning) {
    std::printf("  %-12s %6.1f %%  %s\n", name, 100 * share, meaning);
  };
  std::printf("How much of the volume (places and directions in it, evenly picked) is\n");
  row("seen", coverage.seen, "by a camera");
  row("lit", coverage.lit, "by a projector");
  row("seen_and_lit", coverage.seen_and_lit, "by some camera and projector");
  row("usable", coverage.usable, "by some pair, with depth and lines far enough apart");
  row("grid", coverage.grid, "where lines of two projectors cross and tell each other apart");
  row("skew_grid", coverage.skew_grid, "the same, of projectors whose lines have skew axes");
  row("two_views", coverage.two_views, "where two cameras see the same usable lines");
  row("ambiguous", coverage.ambiguous, "lit by lines of one colour that can be taken for others");
  std::printf("\n");
  std::fflush(stdout);
}

void run_check(const CheckCommand& command) {
  const ThreadLimit threads(command.common.threads);
  if (!command.fit.frames.empty())
    return run_rig_fit(command.common, command.rig_path, command.fit);
  const Rig rig = read_rig(command.rig_path);
  const RigCheck check = check_rig(rig);
  const Json json = to_json(rig, check);
  print_tables(rig, check);
  print_coverage(check.coverage);
  for (const RigWarning& warning : check.warnings) {
    std::cout << (warning.severe ? "SEVERE: " : "warning: ") << warning.text << "\n";
  }
  if (check.warnings.empty()) std::cout << "no warnings\n";
  write_figures(command.common, json);
}

void add_check(CLI::App& group) {
  auto options = std::make_shared<CheckCommand>();
  CLI::App* command =
      group.add_subcommand("check",
                           "Compute what a rig can measure and warn about what it cannot; "
                           "with --frames: whether it still fits what its devices see");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  add_rig_fit_options(*command, options->fit);
  add_common_options(*command, options->common, "pencilscan rig check --rig rig.json");
  command->callback([options] { run_check(*options); });
}

}  // namespace

void add_rig_command(CLI::App& app) {
  CLI::App* group = app.add_subcommand("rig", "Make, check, draw, import and export rigs");
  group->require_subcommand(1);
  group->footer(
      "Example:\n  pencilscan rig ring --out rig.json && pencilscan rig check --rig rig.json");
  add_ring(*group);
  add_check(*group);
  add_rig_files(*group);
}

}  // namespace pencilscan::cli
