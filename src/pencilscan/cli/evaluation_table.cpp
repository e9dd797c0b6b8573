#include "pencilscan/cli/evaluation_table.h"

#include <algorithm>
#include <array>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pencilscan/core/formatted.h"

namespace pencilscan::cli {
namespace {

using Json = nlohmann::ordered_json;

struct Meaning {
  std::string_view key;  ///< or how it begins, where a threshold follows
  std::string_view words;
};

/// docs/figures.md has the definitions; longer beginnings stand first.
constexpr std::array kMeanings = std::to_array<Meaning>({
    {"points", "vertices of points.ply"},
    {"label_error", "share of the points that carry a wrong line"},
    {"labelled_pixels", "points that this is a share of"},
    {"largest_wrong_patch_mm2", "largest connected patch of wrong points, mm2"},
    {"line_recall_3_5px", "the same for lines 3 to 5 px apart in the image"},
    {"line_recall_any_line", "the same, whichever line it was called"},
    {"line_recall", "share of the visible lines' pixels that were found and named right"},
    {"true_line_pixels", "visible line pixels that this is a share of"},
    {"line_error_median_px", "distance of right points to their line in the image, median"},
    {"line_error_p90_px", "and 90th percentile"},
    {"distance_count", "distances that went in"},
    {"distance_median_mm", "distance to the true surface, median"},
    {"distance_p90_mm", "and 90th percentile"},
    {"distance_rms_mm", "and root mean square"},
    {"share_above_2mm", "share farther than 2 mm"},
    {"measurable_share", "share of the true surface that the rig can measure"},
    {"measurable_mm2", "its area, mm2"},
    {"lit_by_1_share", "share of it seen, and lit by at least one projector"},
    {"lit_by_2_share", "and by at least two"},
    {"completeness_lit_by_1_", "the same of what is seen and lit by one"},
    {"completeness_lit_by_2_", "and by two"},
    {"completeness_", "share of the measurable surface with the mesh so near"},
    {"precision_", "share of the mesh so near to the truth"},
    {"f_score_", "harmonic mean of both"},
    {"sigma_count", "vertices that went in"},
    {"sigma_below_1_by_tenth", "the first by tenths of the vertices, from small sigma to large"},
    {"sigma_below_1", "share with an error below their sigma; ideal 0.683"},
    {"sigma_below_2", "below two sigma; ideal 0.954"},
    {"sigma_rank_correlation", "of sigma with the error; 0: sigma tells nothing"},
});

std::string_view meaning_of(std::string_view key) {
  if (key.starts_with("mesh_")) key.remove_prefix(5);
  for (const Meaning& meaning : kMeanings) {
    if (key == meaning.key || (meaning.key.ends_with("_") && key.starts_with(meaning.key)))
      return meaning.words;
  }
  return "";
}

std::string_view group_of(std::string_view key, bool has_lines) {
  if (key == "points" && !has_lines) return "Points";
  if (key.starts_with("mesh_sigma")) return "Sigma of the mesh against its error";
  if (key.starts_with("sigma")) return "Sigma of the points against their error";
  if (key.starts_with("mesh_")) return "Distance of the mesh";
  if (key.find("distance") != key.npos || key.starts_with("share_above")) return "Distance";
  for (const char* start : {"measurable", "lit_by", "completeness", "precision", "f_score"})
    if (key.starts_with(start)) return "Completeness of the mesh";
  return "Lines and their names";
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "none";  // a share of nothing
  if (value.is_array()) {
    std::string text;
    for (const Json& entry : value) text += (text.empty() ? "" : " ") + text_of(entry);
    return text;
  }
  if (!value.is_number_float()) return value.is_string() ? value.get<std::string>() : value.dump();
  return formatted(value.get<double>(), "%.6g");
}

void print_keys(const Json& figures, std::ostream& out) {
  std::size_t key_width = 0;
  std::size_t value_width = 0;
  for (const auto& [key, value] : figures.items()) {
    if (value.is_structured()) continue;
    key_width = std::max(key_width, key.size());
    value_width = std::max(value_width, text_of(value).size());
  }
  const bool has_lines = figures.contains("label_error");
  std::string_view group;
  for (const auto& [key, value] : figures.items()) {
    if (key == "warnings") continue;  // told by the command
    const bool is_list = value.is_array() && (value.empty() || !value[0].is_structured());
    if (value.is_structured() && !is_list) continue;
    if (group_of(key, has_lines) != group) {
      out << (group.empty() ? "" : "\n") << group_of(key, has_lines) << "\n";
      group = group_of(key, has_lines);
    }
    out << "  " << std::left << std::setw(static_cast<int>(key_width)) << key << "  "
        << std::setw(static_cast<int>(value_width)) << text_of(value) << "  " << meaning_of(key)
        << "\n";
  }
}

/// Rows of equal keys, each with its name before it; `head` over the names.
void print_rows(const std::string& title, const std::string& head,
                const std::vector<std::pair<std::string, Json>>& rows, std::ostream& out) {
  if (rows.empty()) return;
  std::size_t name_width = head.size();
  for (const auto& row : rows) name_width = std::max(name_width, row.first.size());
  out << "\n" << title << "\n  " << std::left << std::setw(static_cast<int>(name_width)) << head;
  for (const auto& [key, value] : rows.front().second.items()) out << "  " << key;
  out << "\n";
  for (const auto& [name, values] : rows) {
    out << "  " << std::left << std::setw(static_cast<int>(name_width)) << name << std::right;
    for (const auto& [key, value] : values.items())
      out << "  " << std::setw(static_cast<int>(key.size())) << text_of(value);
    out << "\n";
  }
  out << std::left;
}

std::vector<std::pair<std::string, Json>> named_rows(const Json& figures, const char* key) {
  std::vector<std::pair<std::string, Json>> rows;
  if (!figures.contains(key)) return rows;
  for (const auto& [name, value] : figures[key].items()) rows.emplace_back(name, value);
  return rows;
}

}  // namespace

void print_evaluation(const nlohmann::ordered_json& figures, std::ostream& out) {
  print_keys(figures, out);
  std::vector<std::pair<std::string, Json>> bands;
  if (figures.contains("right_by_confidence")) {
    for (const Json& band : figures["right_by_confidence"])
      bands.emplace_back(text_of(band["confidence"]),
                         Json{{"   right", band["right"]}, {"  points", band["points"]}});
  }
  print_rows("By the points' confidence: share that is right (calibrated: both agree)",
             "confidence", bands, out);
  print_rows("By projector", "projector", named_rows(figures, "by_projector"), out);
  print_rows("By the distance of the lines in the image", "spacing",
             named_rows(figures, "by_spacing"), out);
  if (figures.contains("alignment")) {
    out << "\nThe result was moved onto the truth first\n";
    for (const auto& [key, value] : figures["alignment"].items())
      out << "  " << std::left << std::setw(16) << key << "  " << text_of(value) << "\n";
  }
}

}  // namespace pencilscan::cli
