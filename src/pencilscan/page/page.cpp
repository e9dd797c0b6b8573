#include "pencilscan/page/page.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "pencilscan/core/counted_progress.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/page/advice.h"
#include "pencilscan/page/page_assets.h"
#include "pencilscan/page/sequence_part.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// JSON that may stand inside a <script> element.
std::string script_json(const ordered_json& value) {
  const std::string text =
      value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe.push_back(c);
    }
  }
  return safe;
}

std::vector<std::string> color_texts(const std::vector<PatternColor>& colors) {
  std::vector<std::string> texts;
  for (const PatternColor& color : colors) texts.push_back(color.text());
  return texts;
}

/// rig.json with what the page cannot easily derive: line counts, families of colours, the volume.
ordered_json describe_rig(const Rig& rig, const fs::path& path) {
  ordered_json json = ordered_json(read_json(path));
  ordered_json lines = ordered_json::array();
  for (const Projector& projector : rig.projectors) {
    ordered_json counts = ordered_json::array();
    for (const LinePattern& pattern : projector.patterns) {
      counts.push_back({{"lines", projector.line_count(pattern)},
                        {"vertical", pattern.axis == Axis::kColumn},
                        {"pitch_px", pattern.pitch_px},
                        {"offset_px", pattern.offset_px},
                        {"sequence", pattern.sequence},
                        {"colors", color_texts(pattern.colors)}});
    }
    lines.push_back(std::move(counts));
  }
  ordered_json families = ordered_json::array();
  for (const ColorFamily& family : color_families(rig))
    families.push_back(color_texts(family.colors));
  const Sphere volume = working_volume(rig);
  return {{"cameras", std::move(json["cameras"])},
          {"projectors", std::move(json["projectors"])},
          {"patterns", std::move(lines)},
          {"families", std::move(families)},
          {"unit", unit_name(rig)},
          {"volume",
           {{"center", {volume.center.x(), volume.center.y(), volume.center.z()}},
            {"radius", volume.radius}}}};
}

struct CollectedPart {
  std::string name;
  std::string bytes;
};

struct Collected {
  ordered_json entry;
  std::vector<CollectedPart> parts;
  std::vector<ResultReader::Missing> missing;

  [[nodiscard]] std::size_t embedded_bytes() const {
    std::size_t sum = 0;
    for (const CollectedPart& part : parts) sum += part.bytes.size() * 4 / 3 + 80;
    return sum;
  }
};

Collected collect(const PageData& data, std::size_t result, const Detail& detail) {
  const auto reader = data.open(result, detail);
  Collected collected;
  std::vector<std::string> names;
  for (const std::string& name : reader->part_names()) {
    auto bytes = reader->part(name);
    if (!bytes) continue;
    names.push_back(name);
    collected.parts.push_back({name, std::move(*bytes)});
  }
  collected.entry = data.entry(result, *reader, names);
  collected.entry["detail"] = detail.shape_only ? "shape" : "full";
  collected.missing = reader->missing();
  return collected;
}

/// What the details cost, from rich to poor.
constexpr std::array<Detail, 4> kFullDetails = {{
    {.max_faces = 80'000, .point_stride = 1, .image_width = 1280, .image_quality = 72},
    {.max_faces = 50'000, .point_stride = 2, .image_width = 1280, .image_quality = 60},
    {.max_faces = 30'000, .point_stride = 4, .image_width = 960, .image_quality = 50},
    {.max_faces = 20'000, .point_stride = 8, .image_width = 640, .image_quality = 40},
}};

/// The result with the largest mesh: it says how much results take.
std::size_t largest(const ResultFolder& folder) {
  std::size_t best = 0;
  std::uintmax_t most = 0;
  for (std::size_t i = 0; i < folder.results.size(); ++i) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(folder.results[i].folder / "mesh.ply", error);
    if (error || size <= most) continue;
    most = size;
    best = i;
  }
  return best;
}

struct ShapePlan {
  Detail detail;
  double bytes_each = 0;  ///< about
};

/// Shapes that together take at most about `bytes`, judged by that of one result.
ShapePlan plan_shapes(const PageData& data, std::size_t sample, double bytes) {
  Detail detail;
  detail.shape_only = true;
  detail.max_faces = 4000;
  const Collected tried = collect(data, sample, detail);
  double mesh = 0;
  for (const CollectedPart& part : tried.parts) {
    if (part.name == "mesh") mesh += static_cast<double>(part.bytes.size()) * 4 / 3;
  }
  const double rest = static_cast<double>(tried.embedded_bytes()) - mesh;
  const double room = bytes / static_cast<double>(data.size()) - rest;
  const double faces = room / std::max(1.0, mesh) * static_cast<double>(detail.max_faces);
  const double per_face = mesh / static_cast<double>(detail.max_faces);
  detail.max_faces = static_cast<std::size_t>(std::clamp(faces, 500.0, 20'000.0));
  return {detail, rest + per_face * static_cast<double>(detail.max_faces)};
}

/// All results, each in the detail that there is room for.
std::vector<Collected> collect_all(const PageData& data, std::size_t max_bytes,
                                   const Progress& progress) {
  const std::size_t count = data.size();
  std::vector<Collected> collected(count);
  if (count == 0) return collected;
  if (progress) progress("reading results", 0);
  const auto number = static_cast<double>(count);
  const double room = static_cast<double>(max_bytes) - 1e6;  // 1 MB: the page itself
  constexpr double kShareOfShapes = 0.6;
  // Few results are all whole, if need be in less detail; of many, some are, and at least one.
  constexpr std::size_t kFew = 6;
  constexpr std::size_t kWholeOfMany = 3;
  const std::size_t sample = largest(data.folder());
  const ShapePlan shape =
      count == 1 ? ShapePlan{} : plan_shapes(data, sample, kShareOfShapes * room);
  const auto wanted = static_cast<double>(count <= kFew ? count : kWholeOfMany);
  Detail full;
  double each = 0;
  for (const Detail& detail : kFullDetails) {
    full = detail;
    full.evaluate = count <= 8;
    collected[sample] = collect(data, sample, full);
    each = static_cast<double>(collected[sample].embedded_bytes());
    if (wanted * each + (number - wanted) * shape.bytes_each <= room) break;
  }
  std::size_t whole = count;
  if (number * each > room) {
    const double fit = (room - number * shape.bytes_each) / std::max(1.0, each - shape.bytes_each);
    whole = static_cast<std::size_t>(std::clamp(fit, 1.0, number));
  }
  // Evenly picked, the one that is there already among them.
  std::vector<char> is_whole(count, 0);
  for (std::size_t i = 0; i < whole; ++i) is_whole[(sample + i * count / whole) % count] = 1;
  const auto chunk = 4 * static_cast<std::size_t>(thread_count());
  for (std::size_t first = 0; first < count; first += chunk) {
    const std::size_t last = std::min(first + chunk, count);
    parallel_for(last - first, [&](std::size_t i) {
      const std::size_t result = first + i;
      if (result == sample) return;
      collected[result] = collect(data, result, is_whole[result] != 0 ? full : shape.detail);
    });
    tell_steps(progress, "reading: result", last, count);
  }
  return collected;
}

constexpr std::size_t kLeast = 1'000'000;  ///< bytes for results, whatever else there is

std::size_t embedded_bytes(const ExperimentPage& experiment) {
  std::size_t sum = 0;
  for (const std::string& picture : experiment.pictures) sum += picture.size() * 4 / 3 + 80;
  return sum;
}

/// Pictures may take most of the page where they are all there is, and else a third.
ExperimentDetail experiment_detail(const PageData& data, std::size_t max_bytes) {
  const auto bytes = static_cast<double>(max_bytes);
  ExperimentDetail detail;
  detail.max_bytes =
      static_cast<std::size_t>(data.size() == 0 ? std::max(0.2 * bytes, bytes - 1.2e6) : bytes / 3);
  return detail;
}

/// Nothing in a folder belongs to a result: it is not the one that was meant.
void require_some_used(const fs::path& given, const std::vector<ResultEntry>& results,
                       fs::path ResultEntry::*used, const char* rule) {
  if (given.empty() || results.empty()) return;
  const bool is_used = std::any_of(results.begin(), results.end(), [&](const ResultEntry& entry) {
    return !(entry.*used).empty();
  });
  if (!is_used)
    throw InputError(given.string(), "", "",
                     rule + std::string(", as of result ") + results.front().name);
}

/// "3 (000001, ...) have no mesh in this folder" of results without what others have there.
std::optional<std::string> lacking(const std::vector<ResultEntry>& results, const fs::path& given,
                                   fs::path ResultEntry::*used, const char* what) {
  if (given.empty()) return std::nullopt;
  std::vector<std::string> names;
  for (const ResultEntry& entry : results)
    if ((entry.*used).empty()) names.push_back(entry.name);
  if (names.empty()) return std::nullopt;
  return given.string() + " has no " + what + " of " + counted_names(names) + " of the results";
}

}  // namespace

PageData::PageData(const fs::path& root, const PageOptions& options) : options_(options) {
  for (const fs::path& path :
       {options.sources.rig, options.sources.frames, options.sources.truth}) {
    if (!path.empty() && !fs::exists(path))
      throw InputError(path.string(), "", "", "no such file or folder");
  }
  folder_ = find_results(root, options.sources);
  require_some_used(options.sources.truth, folder_.results, &ResultEntry::truth,
                    "must be a mesh, or hold mesh.ply or <frame>/mesh.ply");
  require_some_used(options.sources.frames, folder_.results, &ResultEntry::captured,
                    "must hold <frame>/ with the pictures");
  experiment_ = find_experiment(root);
  if (experiment_) {  // what the page shows whole need not be named
    std::erase_if(experiment_->runs, [&](const fs::path& run) {
      const auto is_run = [&](const ResultEntry& entry) { return entry.folder == run; };
      const auto& calibrations = folder_.calibrations;
      return std::any_of(folder_.results.begin(), folder_.results.end(), is_run) ||
             std::find(calibrations.begin(), calibrations.end(), run / "calibration.json") !=
                 calibrations.end();
    });
  }
  for (const ResultEntry& entry : folder_.results) {
    if (entry.rig.empty()) {
      rig_of_result_.push_back(-1);
      continue;
    }
    const auto known = std::find(rig_paths_.begin(), rig_paths_.end(), entry.rig);
    rig_of_result_.push_back(static_cast<int>(known - rig_paths_.begin()));
    if (known != rig_paths_.end()) continue;
    rig_paths_.push_back(entry.rig);
    try {
      rigs_.push_back(std::make_shared<const Rig>(read_rig(entry.rig)));
      rig_jsons_.push_back(describe_rig(*rigs_.back(), entry.rig));
    } catch (const InputError&) {
      if (!options.sources.rig.empty()) throw;  // the user named it
      rigs_.emplace_back();
      rig_jsons_.emplace_back(nullptr);
    }
  }
}

std::unique_ptr<ResultReader> PageData::open(std::size_t result, const Detail& detail) const {
  const int rig = rig_of_result_[result];
  return std::make_unique<ResultReader>(
      folder_.results[result], rig < 0 ? nullptr : rigs_[static_cast<std::size_t>(rig)], detail);
}

ordered_json PageData::entry(std::size_t result, ResultReader& reader,
                             const std::vector<std::string>& parts) const {
  const ResultEntry& found = folder_.results[result];
  ordered_json entry = {{"name", found.name},
                        {"run", found.run},
                        {"rig", rig_of_result_[result]},
                        {"truth", !found.truth.empty()},
                        {"scan", reader.is_scan()},
                        {"detail", "full"},
                        {"summary", reader.summary()},
                        {"parts", parts}};
  entry["missing"] = reader.missing_json();
  return entry;
}

std::optional<ExperimentPage> PageData::experiment(const ExperimentDetail& detail) const {
  if (!experiment_) return std::nullopt;
  return read_experiment(*experiment_, detail);
}

ordered_json PageData::index(const std::string& mode, std::vector<ordered_json> entries,
                             const ordered_json& experiment) const {
  ordered_json index = {{"format", "pencilscan-page/1"},
                        {"mode", mode},
                        {"program", options_.program},
                        {"title", options_.title}};
  if (options_.title.empty()) index["title"] = folder_name(folder_.root);
  index["rigs"] = rig_jsons_;
  index["results"] = std::move(entries);
  index["experiment"] = experiment;
  index["sequence"] = is_file(folder_.root / "sequence.json");
  index["failed"] = ordered_json::array();
  for (const fs::path& path : folder_.failed) {
    const Advice advice = advise_failure(path);
    index["failed"].push_back({{"run", run_of(path, folder_.root)},
                               {"frame", path.filename().string()},
                               {"why", advice.warning},
                               {"action", advice.action}});
  }
  index["calibrations"] = ordered_json::array();
  for (const fs::path& path : folder_.calibrations) {
    try {
      index["calibrations"].push_back({{"file", fs::relative(path, folder_.root).string()},
                                       {"report", ordered_json(read_json(path))}});
    } catch (const InputError& error) {
      index["calibrations"].push_back(
          {{"file", fs::relative(path, folder_.root).string()}, {"broken", error.what()}});
    }
  }
  return index;
}

void PageData::require_content(const std::string& verb) const {
  if (!is_empty()) return;
  throw InputError(folder_.root.string(), "", "",
                   "there is nothing to " + verb +
                       ": no result of reconstruct or scan (points.ply, report.json), no "
                       "calibration.json, no experiment, here or in the folders below");
}

PageReport write_report(const fs::path& root, const fs::path& file, const PageOptions& options,
                        const Progress& progress) {
  const PageData data(root, options);
  data.require_content("report");
  const auto experiment = data.experiment(experiment_detail(data, options.max_bytes));
  const std::string sequence = sequence_part(root);
  const std::size_t taken =
      (experiment ? embedded_bytes(*experiment) : 0) + sequence.size() * 4 / 3;
  const std::vector<Collected> collected =
      collect_all(data, options.max_bytes - std::min(taken, options.max_bytes - kLeast), progress);
  const std::size_t count = collected.size();
  PageReport report;
  report.results = count;
  report.full_results = static_cast<std::size_t>(
      std::count_if(collected.begin(), collected.end(),
                    [](const Collected& c) { return c.entry["detail"] == "full"; }));
  std::vector<ordered_json> entries;
  for (std::size_t i = 0; i < count; ++i) {
    entries.push_back(collected[i].entry);
    for (const auto& missing : collected[i].missing)
      report.missing.push_back(data.folder().results[i].name + ": " + missing.what + ": " +
                               missing.why);
  }
  const ResultSources& given = options.sources;
  for (const auto& lack :
       {lacking(data.folder().results, given.truth, &ResultEntry::truth, "mesh"),
        lacking(data.folder().results, given.frames, &ResultEntry::captured, "pictures")})
    if (lack) report.missing.push_back(*lack);
  if (experiment) {
    for (const auto& missing : experiment->json["missing"])
      report.missing.push_back(missing["what"].get<std::string>() + ": " +
                               missing["why"].get<std::string>());
  }
  const PageAssets assets = page_assets();
  const std::string index = script_json(
      data.index("report", std::move(entries), experiment ? experiment->json : ordered_json()));
  write_atomically(file, [&](std::ostream& stream) {
    stream << assets.head;
    const auto embed = [&](const std::string& name, const std::string& bytes) {
      stream << "<script type=\"text/plain\" id=\"part/" << name << "\">" << base64(bytes)
             << "</script>\n";
    };
    for (std::size_t i = 0; i < count; ++i) {
      for (const CollectedPart& part : collected[i].parts)
        embed(std::to_string(i) + "/" + part.name, part.bytes);
    }
    for (std::size_t i = 0; experiment && i < experiment->pictures.size(); ++i)
      embed("experiment/" + std::to_string(i), experiment->pictures[i]);
    if (!sequence.empty()) embed("sequence/0", sequence);
    stream << assets.middle << index << assets.tail;
  });
  report.bytes = fs::file_size(file);
  return report;
}

std::string calibration_page(const ordered_json& calibration, const std::string& title,
                             const std::string& program) {
  const ordered_json none = ordered_json::array();
  return served_page({{"format", "pencilscan-page/1"},
                      {"mode", "report"},
                      {"program", program},
                      {"title", title},
                      {"rigs", none},
                      {"results", none},
                      {"experiment", nullptr},
                      {"sequence", false},
                      {"failed", none},
                      {"calibrations", {{{"file", "calibration.json"}, {"report", calibration}}}}});
}

std::string served_page(const ordered_json& index) {
  const PageAssets assets = page_assets();
  std::string page(assets.head);
  page += assets.middle;
  page += script_json(index);
  page += assets.tail;
  return page;
}

}  // namespace pencilscan
