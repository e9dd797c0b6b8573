#include "pencilscan/cli/own_command.h"

#include <fstream>

#include "pencilscan/core/child_process.h"
#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kTurn = 0.05;  ///< s between looks at a command that runs

/// The last thing it said of itself, without its name.
std::string complaint_in(const fs::path& log) {
  const std::string own = "pencilscan: ";
  std::ifstream file(log);
  std::string last;
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(own)) last = line.substr(own.size());
  return last;
}

}  // namespace

nlohmann::ordered_json run_own_command(const OwnCommand& command,
                                       const std::function<bool()>& go_on) {
  std::vector<std::string> words{fs::read_symlink("/proc/self/exe").string()};
  words.insert(words.end(), command.words.begin(), command.words.end());
  words.insert(words.end(), {"--json", command.json.string()});
  if (command.threads > 0)
    words.insert(words.end(), {"--threads", std::to_string(command.threads)});
  fs::create_directories(command.log.parent_path());
  fs::remove(command.json);
  ChildProcess::Options options;
  options.error_file = command.log.string();
  ChildProcess child(words, options);
  std::optional<int> code;
  while (!(code = child.wait(ChildProcess::Seconds(kTurn))))
    if (!go_on()) throw StageError("stopped");
  if (*code != 0)
    throw StageError(command.words.front() + " failed: " + complaint_in(command.log) + " (" +
                     command.log.string() + ")");
  if (!fs::exists(command.json)) return {};
  return nlohmann::ordered_json(read_json(command.json));
}

std::string own_hash() { return hex(hash_bytes(read_file("/proc/self/exe"))); }

}  // namespace pencilscan::cli
