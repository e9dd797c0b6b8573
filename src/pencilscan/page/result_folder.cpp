#include "pencilscan/page/result_folder.h"

#include <algorithm>
#include <optional>

#include "pencilscan/core/error.h"
#include "pencilscan/page/result_files.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

fs::path first_file(std::initializer_list<fs::path> candidates) {
  for (const fs::path& path : candidates) {
    if (is_file(path)) return path;
  }
  return {};
}

fs::path truth_for(const ResultSources& sources, const fs::path& root, const std::string& frame) {
  if (!sources.truth.empty()) {
    if (is_file(sources.truth)) return sources.truth;
    return first_file({sources.truth / frame / "mesh.ply", sources.truth / "mesh.ply"});
  }
  return first_file({root / "truth" / frame / "mesh.ply", root / "truth" / "mesh.ply",
                     root / "scene" / "truth" / frame / "mesh.ply",
                     root / "scene" / "truth" / "mesh.ply"});
}

ResultEntry entry_for(const fs::path& folder, const fs::path& root, const ResultSources& sources) {
  ResultEntry entry;
  entry.folder = folder;
  const fs::path above = folder.parent_path();
  entry.name = folder == root ? folder_name(root) : folder.filename().string();
  entry.run = run_of(folder, root);
  entry.rig = !sources.rig.empty()
                  ? sources.rig
                  : first_file({above / "devices.json", above / "rig.json", folder / "devices.json",
                                folder / "rig.json", root / "devices.json", root / "rig.json"});
  fs::path beside_run = above;
  beside_run += ".json";
  entry.figures = first_file({folder / "evaluation.json", above / "evaluation.json",
                              entry.run.empty() ? fs::path() : beside_run});
  entry.truth = truth_for(sources, root, entry.name);
  if (!sources.frames.empty()) {
    std::error_code ignored;
    const fs::path captured = sources.frames / entry.name;
    if (fs::is_directory(captured, ignored)) entry.captured = captured;
  }
  return entry;
}

bool looks_like_frame(const fs::path& folder) {
  const std::string name = folder.filename().string();
  return name.size() == 6 &&
         std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// What is wanted of the entries directly in a folder, ordered by name; no links.
template <class IsWanted>
std::vector<fs::path> entries_in(const fs::path& folder, IsWanted is_wanted) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator it(folder, fs::directory_options::skip_permission_denied, error), end;
       !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (!it->is_symlink(ignored) && is_wanted(*it)) entries.push_back(it->path());
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

}  // namespace

/// A frame's folder has points or the report of a frame; `truth/` has a mesh only.
bool holds_result(const fs::path& folder) {
  if (is_file(folder / "points.ply") || is_file(folder / "mesh_measured.ply")) return true;
  return is_file(folder / "report.json") &&
         (is_file(folder / "timing.json") || is_file(folder / "mesh.ply"));
}

std::string run_of(const fs::path& frame, const fs::path& root) {
  const fs::path above = frame.parent_path();
  return frame == root || above == root ? std::string() : fs::relative(above, root).string();
}

std::string folder_name(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  return entries_in(folder, [](const fs::directory_entry& entry) {
    std::error_code ignored;
    return entry.is_directory(ignored);
  });
}

std::vector<fs::path> files_in(const fs::path& folder) {
  return entries_in(folder, [](const fs::directory_entry& entry) {
    std::error_code ignored;
    return entry.is_regular_file(ignored);
  });
}

ResultFolder find_results(const fs::path& root, const ResultSources& sources) {
  std::error_code ignored;
  if (!fs::is_directory(root, ignored))
    throw InputError(root.string(), "", "", "must be an output folder");
  ResultFolder found;
  found.root = root;
  const auto visit = [&](const fs::path& folder, bool of_run) {
    if (holds_result(folder)) {
      found.results.push_back(entry_for(folder, root, sources));
    } else if (of_run && looks_like_frame(folder)) {
      found.failed.push_back(folder);
    }
    const fs::path calibration = folder / "calibration.json";
    if (is_file(calibration)) found.calibrations.push_back(calibration);
    return !found.results.empty() && found.results.back().folder == folder;
  };
  if (visit(root, false)) return found;
  const bool root_is_run = is_file(root / "inputs.json");
  for (const fs::path& folder : folders_in(root)) {
    if (visit(folder, root_is_run)) continue;
    const bool is_run = is_file(folder / "inputs.json");
    for (const fs::path& inner : folders_in(folder)) visit(inner, is_run);
  }
  return found;
}

}  // namespace pencilscan
