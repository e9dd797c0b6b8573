#include "pencilscan/cli/command.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iomanip>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "pencilscan/io/file.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr auto kBarInterval = std::chrono::milliseconds(100);
constexpr auto kLineInterval = std::chrono::seconds(5);
constexpr int kBarWidth = 30;

/// What stderr_progress() remembers between calls.
struct ProgressState {
  std::mutex mutex;
  bool terminal = ::isatty(STDERR_FILENO) == 1;
  Clock::time_point last = Clock::now();
  std::string stage;
};

void show_bar(std::string_view what, double fraction) {
  const int full = static_cast<int>(fraction * kBarWidth);
  std::cerr << "\r\033[K[" << std::string(static_cast<std::size_t>(full), '#')
            << std::string(static_cast<std::size_t>(kBarWidth - full), '.') << "] " << what
            << (fraction >= 1 ? "\n" : "") << std::flush;
}

/// "a.b" for nested objects, so that every figure is one line.
void flatten(const Json& value, const std::string& prefix,
             std::vector<std::pair<std::string, std::string>>& lines) {
  if (value.is_object()) {
    for (const auto& [key, entry] : value.items()) {
      flatten(entry, prefix.empty() ? key : prefix + "." + key, lines);
    }
  } else if (value.is_number_float()) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value.get<double>());
    lines.emplace_back(prefix, text);
  } else if (value.is_string()) {
    lines.emplace_back(prefix, value.get<std::string>());
  } else {
    lines.emplace_back(prefix, value.dump());
  }
}

}  // namespace

void add_common_options(CLI::App& command, CommonOptions& options, const std::string& example) {
  command.add_option("--threads", options.threads, "Threads to use; 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  command.add_option("--json", options.json_path, "Also write the figures to this file")
      ->type_name("FILE");
  command.footer("Example:\n  " + example);
}

Progress stderr_progress() {
  auto state = std::make_shared<ProgressState>();
  return [state](std::string_view what, double fraction) {
    const std::lock_guard lock(state->mutex);
    const bool new_stage = state->stage != what;
    const auto now = Clock::now();
    const bool due = now - state->last >= (state->terminal ? Clock::duration(kBarInterval)
                                                           : Clock::duration(kLineInterval));
    if (!new_stage && !due && !(state->terminal && fraction >= 1)) return;
    state->stage = what;
    state->last = now;
    const double shown = std::clamp(fraction, 0.0, 1.0);
    if (state->terminal) {
      show_bar(what, shown);
    } else {
      std::cerr << what << " " << static_cast<int>(100 * shown) << " %" << std::endl;
    }
  };
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
  if (!options.json_path.empty()) write_json(options.json_path, figures);
}

}  // namespace pencilscan::cli
