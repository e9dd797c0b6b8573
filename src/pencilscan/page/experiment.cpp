#include "pencilscan/page/experiment.h"

#include <algorithm>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/page/experiment_pictures.h"
#include "pencilscan/page/flaw.h"
#include "pencilscan/page/result_files.h"
#include "pencilscan/page/result_folder.h"
#include "pencilscan/page/result_reader.h"
#include "pencilscan/page/table_file.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kMostRows = 2000;     ///< of a table in the page
constexpr std::size_t kMostCommands = 200;  ///< in the page
constexpr std::size_t kMostRuns = 200;
constexpr int kDepth = 4;  ///< of folders below the experiment's

const char* const kPictureFolders[] = {"figures", "images", "pictures", "plots"};

void find_runs(const fs::path& folder, int depth, std::vector<fs::path>& runs) {
  for (const fs::path& inner : folders_in(folder)) {
    if (runs.size() >= kMostRuns) return;
    const bool result = holds_result(inner);
    if (result || is_file(inner / "calibration.json")) runs.push_back(inner);
    if (!result && depth > 1) find_runs(inner, depth - 1, runs);
  }
}

void add_picture_files(const fs::path& folder, const std::string& group,
                       std::vector<ExperimentPicture>& pictures) {
  for (const fs::path& file : files_in(folder)) {
    if (const auto kind = picture_kind(file)) pictures.push_back({file, group, *kind});
  }
}

ordered_json table_json(const std::string& file, const TextTable& table) {
  ordered_json rows = ordered_json::array();
  for (std::size_t i = 0; i < std::min(table.rows.size(), kMostRows); ++i)
    rows.push_back(table.rows[i]);
  return {{"file", file},
          {"title", table.title},
          {"header", table.header},
          {"rows", std::move(rows)},
          {"total", table.rows.size()}};
}

void add_tables(const ExperimentFolder& folder, const FlawNote& note, ordered_json& page) {
  page["tables"] = ordered_json::array();
  bool markdown = false;
  bool values = false;
  for (const fs::path& file : folder.tables) {
    const std::string name = file.filename().string();
    (file.extension() == ".csv" ? values : markdown) = true;
    try {
      for (const TextTable& table : read_tables(file)) {
        page["tables"].push_back(table_json(name, table));
        if (table.rows.empty())
          note(name, "the table has no rows: was the script stopped?", Flaw::kNote);
      }
    } catch (const std::exception& error) {
      note(name, std::string("unreadable: ") + error.what(), Flaw::kUnreadable);
    }
  }
  if (!markdown) {
    note("table.md",
         "not in the folder: the script writes it at its end (--resume goes on where it stopped)",
         Flaw::kMissing);
  }
  if (!values) note("results.csv", "not in the folder: no values of single runs", Flaw::kMissing);
}

/// Title, words and setting, where experiment.json states them.
void add_about(const ExperimentFolder& folder, const FlawNote& note, ordered_json& page) {
  const fs::path file = folder.root / "experiment.json";
  if (!is_file(file)) return;
  try {
    const json about = read_json(file);
    for (const char* key : {"name", "title", "text", "setting"}) {
      if (about.is_object() && about.contains(key) && about[key].is_string())
        page[key] = about[key];
    }
  } catch (const std::exception& error) {
    note("experiment.json", std::string("unreadable: ") + error.what(), Flaw::kUnreadable);
  }
}

void add_commands(const ExperimentFolder& folder, const FlawNote& note, ordered_json& page) {
  const fs::path file = folder.root / "commands.log";
  page["commands"] = ordered_json::array();
  if (!is_file(file)) return;
  try {
    std::istringstream stream(read_file(file));
    std::string line;
    std::size_t count = 0;
    while (std::getline(stream, line)) {
      if (!line.empty() && ++count <= kMostCommands) page["commands"].push_back(line);
    }
    page["commands_total"] = count;
  } catch (const std::exception& error) {
    note("commands.log", std::string("unreadable: ") + error.what(), Flaw::kUnreadable);
  }
}

ordered_json run_json(const fs::path& run, const fs::path& root) {
  ordered_json entry = {{"folder", fs::relative(run, root).generic_string()}};
  if (is_file(run / "report.html")) entry["report"] = true;
  if (!holds_result(run)) {
    entry["kind"] = "calibration";
    try {
      const json report = read_json(run / "calibration.json");
      if (report.is_object() && report.contains("verdict")) entry["verdict"] = report["verdict"];
    } catch (const std::exception& error) {
      entry["broken"] = error.what();
    }
    return entry;
  }
  const ResultFolder found = find_results(run);
  Detail detail;
  detail.shape_only = true;
  ResultReader reader(found.results.front(), nullptr, detail);
  entry["kind"] = reader.is_scan() ? "scan" : "frame";
  entry["summary"] = reader.summary();
  return entry;
}

}  // namespace

std::optional<ExperimentFolder> find_experiment(const fs::path& root) {
  ExperimentFolder folder;
  folder.root = root;
  bool is_one = is_file(root / "experiment.json") || is_file(root / "commands.log") ||
                is_file(root / "table.md");
  for (const fs::path& file : files_in(root)) {
    const std::string ending = file.extension().string();
    if (file.filename() == "sequence.csv") continue;  // of the frames beside it: their time line
    if (ending == ".csv" || ending == ".md") folder.tables.push_back(file);
    is_one = is_one || ending == ".csv";
  }
  if (!is_one) return std::nullopt;
  const auto place = [](const fs::path& file) {
    return std::pair(file.extension() == ".csv", file.filename() != "table.md");
  };
  std::stable_sort(folder.tables.begin(), folder.tables.end(),
                   [&](const auto& a, const auto& b) { return place(a) < place(b); });
  add_picture_files(root, "", folder.pictures);
  for (const char* name : kPictureFolders) add_picture_files(root / name, name, folder.pictures);
  find_runs(root, kDepth, folder.runs);
  return folder;
}

ExperimentPage read_experiment(const ExperimentFolder& folder, const ExperimentDetail& detail) {
  ExperimentPage page;
  page.json = {{"folder", folder_name(folder.root)}};
  ordered_json missing = ordered_json::array();
  const FlawNote note = [&](const std::string& what, const std::string& why, Flaw kind) {
    std::string reason = why;
    const std::string place = folder.root.string() + "/";  // the page need not say where it lay
    const std::size_t at = reason.find(place);
    if (at != std::string::npos) reason.erase(at, place.size());
    missing.push_back({{"what", what}, {"why", reason}, {"kind", to_string(kind)}});
  };
  add_about(folder, note, page.json);
  add_tables(folder, note, page.json);
  add_pictures(folder, detail, note, page);
  page.json["runs"] = ordered_json::array();
  for (const fs::path& run : folder.runs) page.json["runs"].push_back(run_json(run, folder.root));
  add_commands(folder, note, page.json);
  page.json["missing"] = std::move(missing);
  return page;
}

}  // namespace pencilscan
