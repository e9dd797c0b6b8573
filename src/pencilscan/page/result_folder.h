#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pencilscan {

/// One result: the folder of a frame (docs/formats.md), and what belongs to it from outside.
struct ResultEntry {
  std::filesystem::path folder;
  std::string run;                 ///< folder above the frame's within the output; may be empty
  std::string name;                ///< of the frame
  std::filesystem::path rig;       ///< the rig it was made with; empty where none was found
  std::filesystem::path figures;   ///< of `evaluate --json`; empty where none was found
  std::filesystem::path truth;     ///< true mesh; empty where none is known
  std::filesystem::path captured;  ///< folder of the frame's images; empty: pictures/ only
};

/// Where to look for what an output folder does not hold itself; each may be empty.
struct ResultSources {
  std::filesystem::path rig;
  std::filesystem::path frames;  ///< folder of frame folders
  std::filesystem::path truth;   ///< a mesh, or a folder with <frame>/mesh.ply or mesh.ply
};

/// What an output folder holds.
struct ResultFolder {
  std::filesystem::path root;
  std::vector<ResultEntry> results;                 ///< ordered by run and name
  std::vector<std::filesystem::path> calibrations;  ///< reports of calibrate (JSON)
  std::vector<std::filesystem::path> failed;        ///< frame folders without a finished result
};

/// Looks for results in `root` itself, in its folders and in theirs: every folder that holds
/// report.json, points.ply or a mesh.ply is one. Nothing found is no error; InputError when root is
/// no folder.
[[nodiscard]] ResultFolder find_results(const std::filesystem::path& root,
                                        const ResultSources& sources = {});

/// True for a folder that itself holds the result of a frame or a scan.
[[nodiscard]] bool holds_result(const std::filesystem::path& folder);
/// The folder above a frame's within the output; empty where that is the output itself.
[[nodiscard]] std::string run_of(const std::filesystem::path& frame,
                                 const std::filesystem::path& root);
/// Its own name, also of "." and "a/b/".
[[nodiscard]] std::string folder_name(const std::filesystem::path& folder);
/// The folders directly in a folder, ordered by name; no links.
[[nodiscard]] std::vector<std::filesystem::path> folders_in(const std::filesystem::path& folder);
/// The regular files directly in a folder, ordered by name; no links.
[[nodiscard]] std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder);

}  // namespace pencilscan
