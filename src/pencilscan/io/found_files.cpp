#include "pencilscan/io/found_files.h"

#include <algorithm>
#include <vector>

#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

std::string some_of(std::vector<std::string>& names) {
  std::sort(names.begin(), names.end());
  return name_list(names, 4);
}

}  // namespace

bool is_absence(const std::error_code& error) {
  return error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory;
}

std::string holdings(const std::filesystem::path& folder) {
  std::vector<std::string> files;
  std::vector<std::string> folders;
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    if (!name.starts_with('.')) (it->is_directory(ignored) ? folders : files).push_back(name);
  }
  if (error && !is_absence(error)) return "it cannot be listed: " + error.message();
  if (!files.empty()) return "it holds " + some_of(files);
  return folders.empty() ? "it is empty" : "it holds only folders: " + some_of(folders);
}

}  // namespace pencilscan
