#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace pencilscan::cli {

/// A command of this program, to run as a process of its own: what it takes and breaks ends with
/// it.
struct OwnCommand {
  std::vector<std::string> words;  ///< "calibrate", "--devices", ...
  std::filesystem::path log;       ///< for all that it says
  std::filesystem::path json;      ///< for its figures
  int threads = 0;                 ///< 0: all cores
};

/// Its figures (null where it wrote none). `go_on` is asked several times a second; false ends it.
/// StageError with its complaint when it fails, or "stopped". Call it from a thread that lives as
/// long (core/child_process.h).
[[nodiscard]] nlohmann::ordered_json run_own_command(const OwnCommand& command,
                                                     const std::function<bool()>& go_on);

/// Hash of what the linker says that it made, or of this program's file: it tells one build from
/// another.
[[nodiscard]] std::string own_hash();

}  // namespace pencilscan::cli
