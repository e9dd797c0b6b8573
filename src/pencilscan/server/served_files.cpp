#include "pencilscan/server/served_files.h"

#include <algorithm>
#include <map>

namespace pencilscan {

namespace fs = std::filesystem;

std::optional<fs::path> file_inside(const fs::path& root, const std::string& request) {
  if (request.empty() || request.find('\0') != std::string::npos) return std::nullopt;
  const fs::path relative(request);
  if (relative.is_absolute()) return std::nullopt;
  for (const fs::path& part : relative) {
    if (part == "..") return std::nullopt;
  }
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  if (error) return std::nullopt;
  const fs::path real = fs::canonical(real_root / relative, error);
  if (error || !fs::is_regular_file(real, error)) return std::nullopt;
  const auto [end_of_root, rest] =
      std::mismatch(real_root.begin(), real_root.end(), real.begin(), real.end());
  static_cast<void>(rest);
  if (end_of_root != real_root.end()) return std::nullopt;
  return real;
}

std::vector<ServedFile> files_below(const fs::path& root, const fs::path& folder) {
  std::vector<ServedFile> files;
  std::error_code error;
  for (fs::recursive_directory_iterator
           it(folder, fs::directory_options::skip_permission_denied, error),
       end;
       !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_symlink(ignored) || !it->is_regular_file(ignored)) continue;
    files.push_back(
        {fs::relative(it->path(), root, ignored).generic_string(), it->file_size(ignored)});
  }
  std::sort(files.begin(), files.end(),
            [](const ServedFile& a, const ServedFile& b) { return a.path < b.path; });
  return files;
}

std::string content_type(const fs::path& file) {
  static const std::map<std::string, std::string> types = {
      {".json", "application/json"}, {".png", "image/png"},   {".jpg", "image/jpeg"},
      {".webp", "image/webp"},       {".txt", "text/plain"},  {".glb", "model/gltf-binary"},
      {".obj", "text/plain"},        {".tiff", "image/tiff"},
  };
  const auto known = types.find(file.extension().string());
  return known == types.end() ? "application/octet-stream" : known->second;
}

}  // namespace pencilscan
