#include "pencilscan/cli/command.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/io/file.h"
#include "pencilscan/planning/conventions.h"
#include "pencilscan/planning/units.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kFiguresFormat = "figures/1";

/// True for what --json may replace: nothing, or the figures of an earlier run, which say so.
bool may_hold_figures(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return true;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  if (std::filesystem::file_size(path, ignored) == 0) return true;  // as mktemp makes it
  std::ifstream stream(path);
  const Json json = Json::parse(stream, nullptr, false);
  return json.is_object() && json.contains("format") && json["format"] == kFiguresFormat;
}

/// The figures would replace, or be replaced by, what another option of the command names.
void check_own_file(const CLI::App& command, const std::string& path) {
  if (path.empty()) return;
  const auto place_of = [](const std::filesystem::path& named) {
    std::error_code ignored;
    return std::filesystem::weakly_canonical(std::filesystem::absolute(named, ignored), ignored);
  };
  const std::filesystem::path place = place_of(path);
  for (const CLI::Option* option : command.get_options()) {
    if (option->check_lname("json") || option->get_items_expected_max() == 0) continue;
    for (const std::string& value : option->results()) {
      if (place_of(value) != place) continue;
      throw CLI::ValidationError(
          "--json", refusal(path, "a file of its own, and " + option->get_name() + " names it"));
    }
  }
}

/// "a.b" for nested objects, so that every figure is one line.
void flatten(const Json& value, const std::string& prefix,
             std::vector<std::pair<std::string, std::string>>& lines) {
  if (value.is_object()) {
    for (const auto& [key, entry] : value.items()) {
      flatten(entry, prefix.empty() ? key : prefix + "." + key, lines);
    }
  } else if (value.is_number_float()) {
    lines.emplace_back(prefix, formatted(value.get<double>(), "%.6g"));
  } else if (value.is_string()) {
    lines.emplace_back(prefix, value.get<std::string>());
  } else {
    lines.emplace_back(prefix, value.dump());
  }
}

}  // namespace

void add_common_options(CLI::App& command, CommonOptions& options, const std::string& example) {
  command.add_option("--threads", options.threads, "Threads to use; 0: all cores")
      ->check(between(0, 1024))
      ->capture_default_str();
  command.add_option("--seed", options.seed, "Seed of everything random")
      ->check(any_number<std::uint64_t>())
      ->capture_default_str();
  command.add_option("--json", options.json_path, "Also write the figures to this file")
      ->type_name("FILE")
      ->check([](const std::string& path) {
        return may_hold_figures(path)
                   ? std::string()
                   : refusal(path,
                             std::string("a new file or figures of an earlier run (their format "
                                         "is ") +
                                 kFiguresFormat + "), and it holds something else");
      });
  command.parse_complete_callback(
      [&command, &options] { check_own_file(command, options.json_path); });
  command.footer("Example:\n  " + example);
}

void add_overwrite(CLI::App& command, bool& overwrite, const std::string& text,
                   const CLI::Option* of) {
  CLI::Option* option = command.add_flag("--overwrite", overwrite, text);
  if (of != nullptr)
    option->check(told_where_not(
        "--overwrite", [of] { return of->count() > 0; }, "needs " + of->get_name()));
}

void warn_of(const std::optional<std::string>& warning) {
  if (warning) std::cerr << "pencilscan: warning: " << *warning << "\n";
}

void warn_of_rig(const Rig& rig) {
  warn_of(pose_unit_warning(rig));
  warn_of(shared_pose_warning(rig));
  warn_of(volume_unit_warning(rig));
  warn_of(pose_convention_warning(rig));
  warn_of(intrinsics_convention_warning(rig));
}

void print_figures(const CommonOptions& options, const nlohmann::ordered_json& figures) {
  std::vector<std::pair<std::string, std::string>> lines;
  flatten(figures, "", lines);
  std::size_t width = 0;
  for (const auto& line : lines) width = std::max(width, line.first.size());
  for (const auto& [key, value] : lines) {
    std::cout << std::left << std::setw(static_cast<int>(width)) << key << "  " << value << "\n";
  }
  write_figures(options, figures);
}

void write_figures(const CommonOptions& options, const nlohmann::ordered_json& figures) {
  if (options.json_path.empty()) return;
  // Once more: the command itself may have written there.
  if (!may_hold_figures(options.json_path))
    throw InputError("command line", "--json", options.json_path,
                     "must not be another output of the command");
  nlohmann::ordered_json file;
  file["format"] = kFiguresFormat;
  file.update(figures);
  write_json(options.json_path, file);
}

}  // namespace pencilscan::cli
