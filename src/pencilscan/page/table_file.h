#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pencilscan {

/// A table as text. Every row has as many cells as the header.
struct TextTable {
  std::string title;  ///< the text above it; may be empty
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// The tables of a Markdown text (GitHub's dialect: | a | b |, a line of dashes, rows), each with
/// the paragraph before it as its title. Rows are filled up or cut to the header's length.
[[nodiscard]] std::vector<TextTable> markdown_tables(const std::string& text);

/// A table of comma-separated values (RFC 4180) whose first line is the header. Empty lines are
/// passed over; an unfinished quote ends with the text.
[[nodiscard]] TextTable csv_table(const std::string& text);

/// The tables of a .md or .csv file. InputError when it is not readable or holds none.
[[nodiscard]] std::vector<TextTable> read_tables(const std::filesystem::path& file);

}  // namespace pencilscan
