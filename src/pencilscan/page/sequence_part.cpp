#include "pencilscan/page/sequence_part.h"

#include <exception>

#include "pencilscan/io/file.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/page/block.h"
#include "pencilscan/page/result_files.h"

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

ordered_json list_in(const ordered_json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_array() ? *found : ordered_json::array();
}

/// Adds the numbers of one row; columns begin with nulls for the rows before.
void add_numbers(const ordered_json& row, std::size_t index, ordered_json& columns) {
  for (const auto& [name, value] : row.items()) {
    if (!value.is_number()) continue;
    ordered_json& column = columns[name];
    while (column.size() < index) column.push_back(nullptr);
    column.push_back(value);
  }
}

std::string text_in(const ordered_json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

ordered_json sequence_columns(const ordered_json& sequence) {
  ordered_json result = {{"frames", ordered_json::array()},
                         {"states", ordered_json::array()},
                         {"columns", ordered_json::object()},
                         {"remarks", ordered_json::array()}};
  if (!sequence.is_object()) return result;
  for (const char* key : {"events", "holes", "cameras", "projectors"})
    result[key] = list_in(sequence, key);
  for (const ordered_json& row : list_in(sequence, "table")) {
    if (!row.is_object()) continue;
    const std::size_t index = result["frames"].size();
    result["frames"].push_back(text_in(row, "frame"));
    result["states"].push_back(text_in(row, "state"));
    add_numbers(row, index, result["columns"]);
    for (const ordered_json& warning : list_in(row, "warnings"))
      result["remarks"].push_back({index, warning});
  }
  return result;
}

std::string sequence_part(const std::filesystem::path& root) {
  const std::filesystem::path file = root / "sequence.json";
  if (!is_file(file)) return {};
  try {
    return compress(json_line(sequence_columns(ordered_json(read_json(file)))));
  } catch (const std::exception& error) {
    return compress(json_line({{"broken", error.what()}}));
  }
}

}  // namespace pencilscan
