#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/pattern/line_pattern.h"
#include "pencilscan/pattern/solid_color.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan::cli {
namespace {

struct PatternOptions {
  CommonOptions common;
  std::string rig_path;
  std::string out;
  bool gray_code = false;
  bool no_inverses = false;
  bool solids = false;
  bool overwrite = false;
};

std::string file_name(std::size_t position) { return gray_code_file_stem(position) + ".png"; }

/// The files of write_gray_codes().
std::vector<std::filesystem::path> gray_code_files(const PatternOptions& options, const Rig& rig) {
  std::vector<std::filesystem::path> files;
  for (const Projector& projector : rig.projectors) {
    const std::filesystem::path folder = std::filesystem::path(options.out) / projector.name;
    const auto sequence =
        gray_code_sequence(projector.width, projector.height, !options.no_inverses);
    for (std::size_t i = 0; i < sequence.size(); ++i) files.push_back(folder / file_name(i));
    if (options.solids)
      for (const SolidImage& image : solid_images())
        files.push_back(folder / (image.name + ".png"));
    files.push_back(folder / "index.json");
  }
  return files;
}

/// <projector>/NNN.png in the order of docs/formats.md, and index.json that says what each shows.
void write_gray_codes(const PatternOptions& options) {
  const std::filesystem::path out(options.out);
  nlohmann::ordered_json figures;
  const Rig rig = read_devices(options.rig_path).rig;
  for (const auto& file : gray_code_files(options, rig))
    refuse_existing("--out", file, options.overwrite);
  for (const Projector& projector : rig.projectors) {
    const auto sequence =
        gray_code_sequence(projector.width, projector.height, !options.no_inverses);
    nlohmann::ordered_json index = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const GrayCodeImage& image = sequence[i];
      write_image(out / projector.name / file_name(i),
                  render_gray_code(image, projector.width, projector.height));
      nlohmann::ordered_json entry{{"file", file_name(i)}};
      if (image.kind == GrayCodeImage::Kind::kBit) {
        entry["axis"] = image.axis == Axis::kColumn ? "column" : "row";
        entry["bit"] = image.bit;
        entry["inverse"] = image.inverse;
      } else {
        entry["shows"] = image.kind == GrayCodeImage::Kind::kWhite ? "white" : "black";
      }
      index.push_back(entry);
    }
    if (options.solids) {
      for (const SolidImage& image : solid_images()) {
        const cv::Mat panel(projector.height, projector.width, CV_32FC3,
                            cv::Scalar(image.value[0], image.value[1], image.value[2]));
        write_image(out / projector.name / (image.name + ".png"), panel);
        index.push_back({{"file", image.name + ".png"}, {"shows", image.value}});
      }
    }
    write_json(out / projector.name / "index.json",
               {{"width", projector.width}, {"height", projector.height}, {"images", index}});
    figures[projector.name] = {{"images", index.size()}};
  }
  print_figures(options.common, figures);
}

void run_pattern(const PatternOptions& options) {
  const ThreadLimit threads(options.common.threads);
  if (options.gray_code) return write_gray_codes(options);
  const Rig rig = read_rig(options.rig_path);
  require_patterns(rig, options.rig_path, "there is nothing to show");
  const std::filesystem::path out(options.out);
  for (const Projector& projector : rig.projectors)
    refuse_existing("--out", out / (projector.name + ".png"), options.overwrite);
  nlohmann::ordered_json figures;
  for (const Projector& projector : rig.projectors) {
    const auto path = out / (projector.name + ".png");
    write_image(path, render_patterns(projector.patterns, projector.width, projector.height));
    nlohmann::ordered_json lines = nlohmann::ordered_json::array();
    for (const LinePattern& pattern : projector.patterns) {
      lines.push_back(projector.line_count(pattern));
    }
    figures[projector.name] = {{"file", path.string()}, {"lines", lines}};
  }
  print_figures(options.common, figures);
}

}  // namespace

void add_pattern_command(CLI::App& app) {
  auto options = std::make_shared<PatternOptions>();
  CLI::App* command = app.add_subcommand("pattern", "Write what each projector shows");
  command->add_option("--rig", options->rig_path, "The rig (rig.json)")->required();
  command->add_option("--out", options->out, "Folder for <projector>.png, 8 bit, linear light")
      ->required();
  CLI::Option* gray_code = command->add_flag(
      "--gray-code", options->gray_code,
      "Gray codes instead, <projector>/NNN.png with an index.json; sizes suffice");
  command->add_flag("--no-inverses", options->no_inverses, "Leave the inverse images out")
      ->needs(gray_code);
  command->add_flag("--solids", options->solids, "Even colours as well, for crosstalk and gamma")
      ->needs(gray_code);
  add_overwrite(*command, options->overwrite, "Replace pictures that are there");
  add_common_options(*command, options->common, "pencilscan pattern --rig rig.json --out patterns");
  command->callback([options] { run_pattern(*options); });
}

}  // namespace pencilscan::cli
