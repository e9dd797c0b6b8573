#include "pencilscan/recording/time_table.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <sstream>
#include <system_error>

#include "pencilscan/core/byte_order_mark.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/file.h"
#include "pencilscan/recording/recording.h"

namespace pencilscan {
namespace {

std::vector<std::string> words(const std::string& line) {
  std::vector<std::string> result;
  std::istringstream stream(line);
  for (std::string word; std::getline(stream, word, ',');) {
    word.erase(0, word.find_first_not_of(" \t\r"));
    word.erase(word.find_last_not_of(" \t\r") + 1);
    result.push_back(word);
  }
  return result;
}

/// The cameras of the columns. InputError where one has no pictures, or stands twice.
std::vector<std::string> read_header(const std::filesystem::path& file, const std::string& line,
                                     const std::vector<std::string>& cameras) {
  std::vector<std::string> header = words(without_byte_order_mark(line));
  if (header.size() < 2 || header[0] != "frame")
    throw InputError(file.string(), "line 1", line, "must be frame,<camera>,<camera>,...");
  for (auto column = header.begin() + 1; column != header.end(); ++column) {
    if (std::find(cameras.begin(), cameras.end(), *column) == cameras.end()) {
      throw InputError(
          file.string(), "line 1", *column,
          "must be a camera that has pictures (" + name_list(cameras, kNamedFrames) + ")");
    }
    if (std::find(header.begin() + 1, column, *column) != column)
      throw InputError(file.string(), "line 1", *column, "must stand once");
  }
  return header;
}

}  // namespace

TimeTable read_time_table(const std::filesystem::path& file,
                          const std::vector<std::string>& cameras) {
  TimeTable times;
  std::map<std::string, int> line_of;
  std::istringstream lines(read_file(file));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> header = read_header(file, line, cameras);
  for (int number = 2; std::getline(lines, line); ++number) {
    const std::vector<std::string> cells = words(line);
    const auto is_filled = [](const std::string& cell) { return !cell.empty(); };
    if (std::none_of(cells.begin(), cells.end(), is_filled)) continue;
    if (cells.size() > header.size()) {
      throw InputError(file.string(), "line " + std::to_string(number), cells[header.size()],
                       "must have no more cells than line 1: " + std::to_string(header.size()));
    }
    const auto [first, is_new] = line_of.emplace(cells[0], number);
    if (!is_new) {
      throw InputError(
          file.string(), "line " + std::to_string(number), cells[0],
          "must stand once; it stands in line " + std::to_string(first->second) + " as well");
    }
    for (std::size_t c = 1; c < cells.size(); ++c) {
      std::int64_t time = kUnknownTime;
      const char* const end = cells[c].data() + cells[c].size();
      const auto [last, fault] = std::from_chars(cells[c].data(), end, time);
      if (!cells[c].empty() && (fault != std::errc() || last != end)) {
        throw InputError(file.string(), "line " + std::to_string(number) + ", " + header[c],
                         cells[c], "must be whole nanoseconds of at most 64 bits, or nothing");
      }
      times[cells[0]][header[c]] = time;
    }
  }
  return times;
}

std::int64_t time_of(const TimeTable& times, const std::string& frame, const std::string& camera) {
  const auto row = times.find(frame);
  if (row == times.end()) return kUnknownTime;
  const auto cell = row->second.find(camera);
  return cell == row->second.end() ? kUnknownTime : cell->second;
}

std::vector<std::string> unmatched_times(const std::filesystem::path& file, const TimeTable& times,
                                         const FoundFrames& found) {
  std::set<std::string> frames(found.names.begin(), found.names.end());
  frames.erase("");  // of rows without a folder
  std::vector<std::string> rows;
  for (const auto& [name, cells] : times) {
    if (!frames.contains(name)) rows.push_back(name);
  }
  if (!times.empty() && rows.size() == times.size()) {
    throw InputError(file.string(), "frame", rows.front(),
                     "must be the name of a frame folder, such as " + found.names.back());
  }
  std::vector<std::string> warnings;
  if (!rows.empty())
    warnings.push_back(file.string() + ": rows of no frame folder: " + counted_names(rows));
  for (const auto& [camera, pictures] : found.cameras) {
    std::vector<std::string> untimed;
    for (const auto& [row, picture] : pictures) {
      if (time_of(times, found.names[row], camera) == kUnknownTime)
        untimed.push_back(found.names[row]);
    }
    if (!untimed.empty())
      warnings.push_back(file.string() + ": pictures of camera " + camera +
                         " without a time stamp: " + counted_names(untimed));
  }
  return warnings;
}

}  // namespace pencilscan
