#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan {

/// A picture that an experiment left in its folder.
struct ExperimentPicture {
  enum class Kind { kStill, kDrawing, kMoving, kVideo };
  std::filesystem::path file;
  std::string group;  ///< the folder within the experiment's; empty: directly in it
  Kind kind = Kind::kStill;
};

/// What a script of experiments/ leaves: tables, plots and pictures, and runs of the program.
struct ExperimentFolder {
  std::filesystem::path root;
  std::vector<std::filesystem::path> tables;  ///< Markdown first, then CSV; table.md before others
  std::vector<ExperimentPicture> pictures;    ///< by group and name
  std::vector<std::filesystem::path> runs;    ///< folders of frames and calibrations, any depth
};

/// Looks for an experiment: a folder with experiment.json, commands.log, table.md or a CSV file.
/// Nothing for other folders. Links are not followed.
[[nodiscard]] std::optional<ExperimentFolder> find_experiment(const std::filesystem::path& root);

/// How much of an experiment the page gets.
struct ExperimentDetail {
  int max_width = 1600;                 ///< of a picture directly in the folder, px
  int gallery_width = 480;              ///< of one in a folder of pictures, px
  int quality = 82;                     ///< WebP, 1..100
  std::size_t max_bytes = 100'000'000;  ///< of all pictures, as they are embedded (base64)
};

/// An experiment as the page shows it.
struct ExperimentPage {
  nlohmann::ordered_json json;  ///< folder, title, text, setting, tables, pictures, runs, commands,
                                ///< missing (docs/report.md)
  std::vector<std::string> pictures;  ///< bytes; "part" of an entry of json["pictures"] counts them
};

/// Reads everything. What is missing or broken is named in json["missing"], with the reason.
[[nodiscard]] ExperimentPage read_experiment(const ExperimentFolder& folder,
                                             const ExperimentDetail& detail = {});

}  // namespace pencilscan
