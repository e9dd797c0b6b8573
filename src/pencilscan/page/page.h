#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/core/progress.h"
#include "pencilscan/page/experiment.h"
#include "pencilscan/page/result_folder.h"
#include "pencilscan/page/result_reader.h"

namespace pencilscan {

struct PageOptions {
  ResultSources sources;
  std::string title;                   ///< empty: the name of the folder
  std::size_t max_bytes = 15'000'000;  ///< of report.html, >= 1 MB; aimed at, never cut off
  std::string program = "pencilscan";  ///< with its version, for the foot of the page
};

/// What became of a report.
struct PageReport {
  std::size_t bytes = 0;
  std::size_t results = 0;
  std::size_t full_results = 0;      ///< with points and images; the others have their shape
  std::vector<std::string> missing;  ///< "<result>: <what>: <why>"
};

/// An output folder as data for the page.
class PageData {
 public:
  /// Finds and reads what all results share. InputError when root is no folder or a file named in
  /// options.sources does not exist.
  PageData(const std::filesystem::path& root, const PageOptions& options);

  [[nodiscard]] std::size_t size() const { return folder_.results.size(); }
  /// True where a page would show nothing: no result, no frame that failed, no calibration, no
  /// experiment.
  [[nodiscard]] bool is_empty() const {
    return folder_.results.empty() && folder_.failed.empty() && folder_.calibrations.empty() &&
           !experiment_;
  }
  /// InputError where that is so; `verb`: what cannot be done then ("report").
  void require_content(const std::string& verb) const;
  /// A reader of one result.
  [[nodiscard]] std::unique_ptr<ResultReader> open(std::size_t result, const Detail& detail) const;
  /// The index of the page: devices, per result what `entries` holds, and what is known of the
  /// experiment (null: none). mode: report or view.
  [[nodiscard]] nlohmann::ordered_json index(const std::string& mode,
                                             std::vector<nlohmann::ordered_json> entries,
                                             const nlohmann::ordered_json& experiment = {}) const;
  /// One entry of the index.
  [[nodiscard]] nlohmann::ordered_json entry(std::size_t result, ResultReader& reader,
                                             const std::vector<std::string>& parts) const;
  [[nodiscard]] const ResultFolder& folder() const { return folder_; }
  /// The experiment whose folder it is, read; nothing for other folders.
  [[nodiscard]] std::optional<ExperimentPage> experiment(const ExperimentDetail& detail) const;

 private:
  PageOptions options_;
  ResultFolder folder_;
  std::optional<ExperimentFolder> experiment_;
  std::vector<std::filesystem::path> rig_paths_;   ///< distinct ones
  std::vector<std::shared_ptr<const Rig>> rigs_;   ///< null where unreadable
  std::vector<nlohmann::ordered_json> rig_jsons_;  ///< null where unreadable
  std::vector<int> rig_of_result_;                 ///< -1: none
};

/// Writes one self-contained HTML page of all that is in the folder, whole or not at all. With many
/// results, those that fit are whole and the others have shape and figures only. InputError where
/// the folder holds nothing to show.
[[nodiscard]] PageReport write_report(const std::filesystem::path& root,
                                      const std::filesystem::path& file,
                                      const PageOptions& options = {},
                                      const Progress& progress = {});

/// The page of one calibration (calibration.json), whole in one HTML file.
[[nodiscard]] std::string calibration_page(const nlohmann::ordered_json& calibration,
                                           const std::string& title, const std::string& program);

/// The page without data, which asks the server for it. `index` is embedded.
[[nodiscard]] std::string served_page(const nlohmann::ordered_json& index);

}  // namespace pencilscan
