#include "pencilscan/cli/own_command.h"

#include <elf.h>
#include <link.h>

#include <cstring>
#include <fstream>
#include <string_view>

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

/// The build ID among notes of an ELF file, each a head, a name and a text; empty: there is none.
std::string build_id_in(std::string_view notes) {
  constexpr std::string_view kName("GNU\0", 4);
  const auto padded = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
  ElfW(Nhdr) head;
  while (notes.size() >= sizeof head) {
    std::memcpy(&head, notes.data(), sizeof head);
    const std::size_t text = sizeof head + padded(head.n_namesz);
    const std::size_t end = text + padded(head.n_descsz);
    if (end > notes.size()) break;
    if (head.n_type == NT_GNU_BUILD_ID && notes.substr(sizeof head, head.n_namesz) == kName)
      return std::string(notes.substr(text, head.n_descsz));
    notes.remove_prefix(end);
  }
  return {};
}

/// What the linker made of all that it put into this program (--build-id); empty where it wrote
/// none.
std::string build_id() {
  std::string id;
  const auto visit = [](dl_phdr_info* info, std::size_t, void* result) {
    auto& found = *static_cast<std::string*>(result);
    for (int i = 0; i < info->dlpi_phnum && found.empty(); ++i) {
      const ElfW(Phdr)& part = info->dlpi_phdr[i];
      if (part.p_type == PT_NOTE)
        found = build_id_in(
            {reinterpret_cast<const char*>(info->dlpi_addr + part.p_vaddr), part.p_memsz});
    }
    return 1;  // the first object is the program
  };
  dl_iterate_phdr(visit, &id);
  return id;
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

std::string own_hash() {
  const std::string id = build_id();
  return hex(hash_bytes(id.empty() ? read_file("/proc/self/exe") : id));
}

}  // namespace pencilscan::cli
