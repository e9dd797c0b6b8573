#include "pencilscan/recording/pack.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdio>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "pencilscan/core/byte_order_mark.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/io/zarr_array.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTimesFile = "timestamps.csv";

/// Pictures of one camera by their row.
using CameraFiles = std::map<std::size_t, fs::path>;

struct FoundFrames {
  std::vector<std::string> names;              ///< by row; empty: no folder, or one of no picture
  std::vector<std::string> without_picture;    ///< names of folders
  std::map<std::string, CameraFiles> cameras;  ///< by name
};

bool is_number(const std::string& name) {
  return std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_six_digits(const std::string& name) { return name.size() == 6 && is_number(name); }

std::string without_leading_zeros(const std::string& digits) {
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size()));
}

/// Order of whole numbers of any length, and by name where they are equal (1, 01).
bool is_less_by_number(const std::string& a, const std::string& b) {
  const std::string x = without_leading_zeros(a);
  const std::string y = without_leading_zeros(b);
  if (x.size() != y.size()) return x.size() < y.size();
  return x == y ? a < b : x < y;
}

/// The numbers in two names at the first place where the names differ; empty: there is none.
std::pair<std::string, std::string> first_other_numbers(const std::string& a,
                                                        const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto differs = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  std::size_t begin = static_cast<std::size_t>(differs - a.begin());
  while (begin > 0 && is_digit(a[begin - 1])) --begin;
  const auto number = [&](const std::string& name) {
    const auto from = name.begin() + static_cast<std::ptrdiff_t>(begin);
    return std::string(from, std::find_if_not(from, name.end(), is_digit));
  };
  return {number(a), number(b)};
}

/// Not the pictures' own folder, nor one around it: both would go where they are replaced.
void refuse_frames_as_output(const fs::path& frames, const fs::path& out) {
  const fs::path inner = fs::weakly_canonical(bare_folder(frames));
  const fs::path outer = fs::weakly_canonical(bare_folder(out));
  if (std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end())
    throw InputError("--out", "", out.string(),
                     "must not be the folder of --frames, nor one around it");
}

FoundFrames find_pictures(const fs::path& folder) {
  const std::vector<std::string> names = frame_folder_names(folder);
  const bool numbered = std::all_of(names.begin(), names.end(), is_six_digits);
  FoundFrames found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t row = numbered ? std::stoul(names[i]) : i;
    bool any = false;
    for (const auto& entry : fs::directory_iterator(folder / names[i])) {
      const std::string camera = entry.path().stem().string();
      const auto file = find_image(folder / names[i], camera);
      if (!file || *file != entry.path()) continue;
      found.cameras[camera][row] = *file;
      any = true;
    }
    if (!any) {
      found.without_picture.push_back(names[i]);
      continue;
    }
    found.names.resize(row + 1);
    found.names[row] = names[i];
  }
  if (found.cameras.empty()) {
    throw InputError(folder.string(), "images", "none",
                     "must hold images such as " + names.front() + "/cam0.png; of " +
                         names.front() + ", " + holdings(folder / names.front()));
  }
  return found;
}

RecordedCamera camera_of(const std::string& name, const fs::path& file, double exposure_us) {
  const cv::Mat image = read_stored_image(file);
  if (image.depth() == CV_32F)
    throw InputError(file.string(), "", "", "must have 8 or 16 bit per channel");
  return {name,       image.cols, image.rows, image.channels(), image.depth() == CV_8U ? 8 : 16,
          exposure_us};
}

std::string describe(int width, int height, int type) {
  return std::to_string(width) + "x" + std::to_string(height) +
         (CV_MAT_CN(type) == 3 ? " colour, " : " grey, ") +
         (CV_MAT_DEPTH(type) == CV_8U ? "8" : "16") + " bit";
}

cv::Mat read_like(const RecordedCamera& camera, const fs::path& file) {
  cv::Mat image = read_stored_image(file);
  if (image.cols != camera.width || image.rows != camera.height ||
      image.type() != camera.image_type()) {
    throw InputError(file.string(), "image", describe(image.cols, image.rows, image.type()),
                     "must be " + describe(camera.width, camera.height, camera.image_type()) +
                         " as the camera's first one");
  }
  return image;
}

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

/// Time stamps by frame name and camera.
using Times = std::map<std::string, std::map<std::string, std::int64_t>>;

/// The cameras of the columns. InputError where one has no pictures, or stands twice.
std::vector<std::string> read_header(const fs::path& file, const std::string& line,
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

/// Empty cells are unknown.
Times read_times(const fs::path& file, const std::vector<std::string>& cameras) {
  Times times;
  std::map<std::string, int> line_of;
  std::istringstream lines(read_file(file));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> header = read_header(file, line, cameras);
  for (int number = 2; std::getline(lines, line); ++number) {
    const std::vector<std::string> cells = words(line);
    if (cells.empty()) continue;
    const auto [first, is_new] = line_of.emplace(cells[0], number);
    if (!is_new) {
      throw InputError(
          file.string(), "line " + std::to_string(number), cells[0],
          "must stand once; it stands in line " + std::to_string(first->second) + " as well");
    }
    for (std::size_t c = 1; c < cells.size() && c < header.size(); ++c) {
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

std::int64_t time_of(const Times& times, const std::string& frame, const std::string& camera) {
  const auto row = times.find(frame);
  if (row == times.end()) return kUnknownTime;
  const auto cell = row->second.find(camera);
  return cell == row->second.end() ? kUnknownTime : cell->second;
}

/// "3 (000012, 000020, 000021)".
std::string counted(const std::vector<std::string>& names) {
  return std::to_string(names.size()) + " (" + name_list(names, kNamedFrames) + ")";
}

/// Warns of time stamps and pictures without the other. InputError where no row is of a frame.
std::vector<std::string> unmatched(const fs::path& file, const Times& times,
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
    warnings.push_back(file.string() + ": rows of no frame folder: " + counted(rows));
  for (const auto& [camera, pictures] : found.cameras) {
    std::vector<std::string> untimed;
    for (const auto& [row, picture] : pictures) {
      if (time_of(times, found.names[row], camera) == kUnknownTime)
        untimed.push_back(found.names[row]);
    }
    if (!untimed.empty())
      warnings.push_back(file.string() + ": pictures of camera " + camera +
                         " without a time stamp: " + counted(untimed));
  }
  return warnings;
}

/// True where unpacking writes times.
bool has_times(const Recording& recording, const FrameSets& sets) {
  for (const FrameSet& set : sets.sets) {
    for (std::size_t c = 0; c < set.rows.size(); ++c) {
      if (set.rows[c] && recording.timestamp_ns(*set.rows[c], c) != kUnknownTime) return true;
    }
  }
  return false;
}

/// True where unpacking writes a picture of this row.
bool is_there(const Recording& recording, std::optional<std::size_t> row, std::size_t camera) {
  std::error_code ignored;
  return row && recording.valid(*row, camera) &&
         fs::exists(recording.picture_file(*row, camera), ignored);
}

/// What is there and is not written anew would be one sequence with what is. It may be foreign, so
/// it is named and not deleted.
void refuse_what_would_stay(const Recording& recording, const FrameSets& sets,
                            const fs::path& out) {
  if (!fs::is_directory(out)) return;
  const auto refuse = [](const fs::path& file) {
    throw InputError("--out", "", file.string(),
                     "must not stay: it would be taken for a part of this recording; remove it, or "
                     "name a new folder");
  };
  if (!has_times(recording, sets) && fs::exists(out / kTimesFile)) refuse(out / kTimesFile);
  std::map<std::string, std::size_t> frames;
  for (std::size_t k = 0; k < sets.sets.size(); ++k) frames[six_digits(sets.sets[k].number)] = k;
  for (const auto& entry : fs::directory_iterator(out)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || name.starts_with('.')) continue;
    const auto frame = frames.find(name);
    const FolderImages images(entry.path());
    for (const std::string& stem : images.stems()) {
      const fs::path file = images.find(stem).value_or("");
      if (file.empty()) continue;
      const auto camera = recording.camera_named(stem);
      const bool is_replaced = frame != frames.end() && camera && file.extension() == ".png" &&
                               is_there(recording, sets.sets[frame->second].rows[*camera], *camera);
      if (!is_replaced) refuse(file);
    }
  }
}

}  // namespace

std::optional<std::string> order_warning(std::span<const std::string> names) {
  for (std::size_t i = 1; i < names.size(); ++i) {
    const auto [before, after] = first_other_numbers(names[i - 1], names[i]);
    if (before.empty() || after.empty() || !is_less_by_number(after, before)) continue;
    if (std::all_of(names.begin(), names.end(), is_number)) continue;
    return "frames are taken in the order of their names, in which " + names[i - 1] +
           " comes before " + names[i] +
           ": where their numbers count, give all as many digits, or name them by digits alone";
  }
  return std::nullopt;
}

std::vector<std::string> left_out_warnings(const Recording& recording, const FrameSets& sets) {
  std::vector<std::string> warnings;
  if (!sets.no_frame.empty()) {
    std::vector<std::string> names;
    for (const std::size_t number : sets.no_frame) names.push_back(six_digits(number));
    warnings.push_back(
        std::string(sets.by_row ? "rows" : "moments") +
        " of the recording that have no picture, and are no frames: " + counted(names));
  }
  for (std::size_t c = 0; c < sets.clocks.size(); ++c) {
    std::vector<std::string> rows;
    for (const std::size_t row : sets.clocks[c].left_out) rows.push_back(six_digits(row));
    if (rows.empty()) continue;
    warnings.push_back("pictures of camera " + recording.cameras()[c].name +
                       " in no frame, since they have no time stamp and nothing else tells their "
                       "moment: " +
                       counted(rows));
  }
  return warnings;
}

std::vector<std::string> frame_folder_names(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw InputError(folder.string(), "", "", "must be a folder that holds frame folders");
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::string name = entry.path().filename().string();
    if (entry.is_directory() && !name.starts_with('.')) names.push_back(std::move(name));
  }
  if (names.empty()) {
    throw InputError(folder.string(), "frame folders", "none",
                     "must hold at least one frame folder such as 000000; " + holdings(folder));
  }
  if (std::all_of(names.begin(), names.end(), is_number))
    std::sort(names.begin(), names.end(), is_less_by_number);
  else
    std::sort(names.begin(), names.end());
  return names;
}

std::string six_digits(std::size_t frame) {
  char name[24];
  std::snprintf(name, sizeof name, "%06zu", frame);
  return name;
}

PackReport pack_recording(const fs::path& frames, const fs::path& out, const PackOptions& options,
                          const Progress& progress) {
  refuse_frames_as_output(frames, out);
  const FoundFrames found = find_pictures(frames);
  fs::path times_file = options.times;
  if (times_file.empty() && fs::exists(frames / kTimesFile)) times_file = frames / kTimesFile;
  PackReport report;
  report.frames = static_cast<std::size_t>(
      std::count_if(found.names.begin(), found.names.end(),
                    [](const std::string& name) { return !name.empty(); }));
  std::vector<RecordedCamera> cameras;
  std::vector<const CameraFiles*> files;
  for (const auto& [name, pictures] : found.cameras) {
    cameras.push_back(camera_of(name, pictures.begin()->second, options.exposure_us));
    files.push_back(&pictures);
    report.cameras.push_back(name);
    report.pictures += pictures.size();
  }
  report.missing = report.frames * cameras.size() - report.pictures;
  Times times;
  if (!times_file.empty()) {
    times = read_times(times_file, report.cameras);
    report.warnings = unmatched(times_file, times, found);
  }
  if (!found.without_picture.empty())
    report.warnings.push_back(
        "frame folders without a picture, which the recording does not hold: " +
        counted(found.without_picture));
  if (auto warning = order_warning(found.names)) report.warnings.push_back(std::move(*warning));
  // A film is a Zarr group, too.
  const bool replaces =
      options.overwrite && Recording::is_one(out) && read_zarr_group(out).contains("cameras");
  check_recorded(out, cameras, replaces ? OutFolder::kReplaced : OutFolder::kNew);
  RecordingOptions recording_options;
  recording_options.compression = options.compression;
  ReplacingFolder making(out);
  RecordingWriter writer(making.path(), cameras, recording_options);
  std::atomic<std::size_t> written{0};
  parallel_for(cameras.size(), [&](std::size_t c) {
    for (const auto& [row, file] : *files[c]) {
      writer.write(row, c, read_like(cameras[c], file),
                   time_of(times, found.names[row], cameras[c].name));
      const std::size_t done = ++written;
      if (progress && c == 0)
        progress("packing", static_cast<double>(done) / static_cast<double>(report.pictures));
    }
  });
  writer.close();
  making.publish();
  if (progress) progress("packing", 1);
  return report;
}

PackReport unpack_recording(const Recording& recording, const FrameSets& sets, const fs::path& out,
                            const Progress& progress) {
  refuse_what_would_stay(recording, sets, out);
  PackReport report;
  report.frames = sets.sets.size();
  for (const RecordedCamera& camera : recording.cameras()) report.cameras.push_back(camera.name);
  std::atomic<std::size_t> pictures{0};
  std::mutex telling;
  std::size_t done = 0;  // guarded by `telling`
  const std::size_t cameras = recording.cameras().size();
  parallel_for(sets.sets.size(), [&](std::size_t k) {
    const std::string name = six_digits(sets.sets[k].number);
    fs::create_directories(out / name);
    for (std::size_t c = 0; c < cameras; ++c) {
      const auto row = sets.sets[k].rows[c];
      const cv::Mat image = row ? recording.read(*row, c) : cv::Mat();
      if (image.empty()) continue;
      write_image(out / name / (recording.cameras()[c].name + ".png"), image,
                  recording.cameras()[c].bit_depth);
      ++pictures;
    }
    if (!progress) return;
    const std::lock_guard lock(telling);
    progress("unpacking", static_cast<double>(++done) / static_cast<double>(report.frames));
  });
  report.pictures = pictures;
  report.missing = report.frames * cameras - report.pictures;
  report.warnings = left_out_warnings(recording, sets);
  if (!has_times(recording, sets)) return report;
  std::string table = "frame";
  for (const RecordedCamera& camera : recording.cameras()) table += "," + camera.name;
  for (const FrameSet& set : sets.sets) {
    table += "\n" + six_digits(set.number);
    for (std::size_t c = 0; c < cameras; ++c) {
      const auto row = set.rows[c];
      const std::int64_t time = row ? recording.timestamp_ns(*row, c) : kUnknownTime;
      table += "," + (time == kUnknownTime ? std::string() : std::to_string(time));
    }
  }
  write_text(out / kTimesFile, table + "\n");
  return report;
}

}  // namespace pencilscan
