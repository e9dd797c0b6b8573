#include "pencilscan/page/table_file.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

std::string trimmed(const std::string& text) {
  constexpr const char* kBlank = " \t\r\n";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// "| a | b \| c |" -> {"a", "b | c"}
std::vector<std::string> markdown_cells(const std::string& line) {
  std::vector<std::string> cells;
  std::string cell;
  for (std::size_t i = 1; i < line.size(); ++i) {
    if (line[i] == '\\' && i + 1 < line.size() && line[i + 1] == '|') {
      cell += '|';
      ++i;
    } else if (line[i] == '|') {
      cells.push_back(trimmed(cell));
      cell.clear();
    } else {
      cell += line[i];
    }
  }
  if (!trimmed(cell).empty()) cells.push_back(trimmed(cell));  // the last bar is optional
  return cells;
}

bool is_rule(const std::string& line) {
  return line.find('-') != std::string::npos &&
         line.find_first_not_of("|-: \t") == std::string::npos;
}

void make_even(TextTable& table) {
  for (auto& row : table.rows) row.resize(table.header.size());
}

/// The rows of a file, of any length each.
std::vector<std::vector<std::string>> csv_rows(const std::string& text) {
  std::vector<std::vector<std::string>> rows(1, {""});
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    std::string& cell = rows.back().back();
    if (quoted) {
      if (c != '"') {
        cell += c;
      } else if (i + 1 < text.size() && text[i + 1] == '"') {
        cell += text[++i];
      } else {
        quoted = false;
      }
    } else if (c == '"') {
      quoted = true;
    } else if (c == ',') {
      rows.back().emplace_back();
    } else if (c == '\n') {
      rows.push_back({""});
    } else if (c != '\r') {
      cell += c;
    }
  }
  std::erase_if(rows, [](const auto& row) { return row.size() == 1 && row[0].empty(); });
  return rows;
}

}  // namespace

std::vector<TextTable> markdown_tables(const std::string& text) {
  std::vector<TextTable> tables;
  std::istringstream stream(text);
  std::string line;
  std::string header;  // a line that a rule may follow
  std::string title;
  bool inside = false;  // a table
  bool new_paragraph = true;
  while (std::getline(stream, line)) {
    line = trimmed(line);
    const std::string before = std::exchange(header, "");
    if (!line.starts_with('|')) {
      inside = false;
      const std::size_t words = line.find_first_not_of("# ");
      if (words == std::string::npos) {
        new_paragraph = true;
        continue;
      }
      title = (new_paragraph ? "" : title + " ") + line.substr(words);
      new_paragraph = false;
    } else if (inside) {
      tables.back().rows.push_back(markdown_cells(line));
    } else if (is_rule(line) && !before.empty()) {
      tables.push_back({std::exchange(title, ""), markdown_cells(before), {}});
      inside = new_paragraph = true;
    } else {
      header = line;
    }
  }
  for (TextTable& table : tables) make_even(table);
  return tables;
}

TextTable csv_table(const std::string& text) {
  TextTable table;
  auto rows = csv_rows(text);
  if (rows.empty()) return table;
  table.header = std::move(rows.front());
  rows.erase(rows.begin());
  table.rows = std::move(rows);
  make_even(table);
  return table;
}

std::vector<TextTable> read_tables(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  std::vector<TextTable> tables;
  if (file.extension() == ".csv") {
    tables.push_back(csv_table(text));
    if (tables.back().header.empty()) tables.clear();
  } else {
    tables = markdown_tables(text);
  }
  if (tables.empty()) throw InputError(file.string(), "", "", "must hold a table");
  return tables;
}

}  // namespace pencilscan
