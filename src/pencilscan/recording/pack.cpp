#include "pencilscan/recording/pack.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/output_place.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/io/zarr_array.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/recording/time_table.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTimesFile = "timestamps.csv";

/// Not the pictures' own folder, nor one around it: both would go where they are replaced.
void refuse_frames_as_output(const fs::path& frames, const fs::path& out) {
  const fs::path inner = fs::weakly_canonical(bare_folder(frames));
  const fs::path outer = fs::weakly_canonical(bare_folder(out));
  if (std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end())
    throw InputError("--out", "", out.string(),
                     "must not be the folder of --frames, nor one around it");
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

/// Of a camera whose time stamps do not grow from row to row: digits or rows were changed, and its
/// pictures would be put beside those of other moments.
std::optional<std::string> disorder_warning(const std::string& camera,
                                            const std::vector<std::int64_t>& times_ns,
                                            const std::function<std::string(std::size_t)>& name) {
  std::vector<std::string> rows;
  std::int64_t before = kUnknownTime;
  for (std::size_t row = 0; row < times_ns.size(); ++row) {
    if (times_ns[row] == kUnknownTime) continue;
    if (before != kUnknownTime && times_ns[row] <= before) rows.push_back(name(row));
    before = times_ns[row];
  }
  if (rows.empty()) return std::nullopt;
  return "time stamps of camera " + camera + " that do not come after the one before, at " +
         counted_names(rows) + ": its pictures go to frames of other moments there";
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

std::string table_of_times(const Recording& recording, const FrameSets& sets) {
  std::string table = "frame";
  for (const RecordedCamera& camera : recording.cameras()) table += "," + camera.name;
  for (const FrameSet& set : sets.sets) {
    table += "\n" + six_digits(set.number);
    for (std::size_t c = 0; c < recording.cameras().size(); ++c) {
      const auto row = set.rows[c];
      const std::int64_t time = row ? recording.timestamp_ns(*row, c) : kUnknownTime;
      table += "," + (time == kUnknownTime ? std::string() : std::to_string(time));
    }
  }
  return table + "\n";
}

}  // namespace

std::vector<std::string> recording_warnings(const Recording& recording, const FrameSets& sets) {
  constexpr double kLeastPeriodNs = 1e5;  // no camera takes 10,000 pictures a second of a whole rig
  std::vector<std::string> warnings;
  if (sets.period_ns > 0 && sets.period_ns < kLeastPeriodNs)
    warnings.push_back(
        "time stamps lie " + formatted(sets.period_ns) + " ns apart, which is " +
        formatted(1e9 / sets.period_ns) +
        " pictures a second: they must be nanoseconds (milliseconds times 1,000,000, microseconds "
        "times 1,000)");
  if (!sets.no_frame.empty()) {
    std::vector<std::string> names;
    for (const std::size_t number : sets.no_frame) names.push_back(six_digits(number));
    warnings.push_back(
        std::string(sets.by_row ? "rows" : "moments") +
        " of the recording that have no picture, and are no frames: " + counted_names(names));
  }
  for (std::size_t c = 0; c < sets.clocks.size(); ++c) {
    std::vector<std::int64_t> times;
    for (std::size_t row = 0; row < recording.row_count(); ++row)
      times.push_back(recording.timestamp_ns(row, c));
    auto disorder = disorder_warning(recording.cameras()[c].name, times, six_digits);
    if (disorder) warnings.push_back(std::move(*disorder));
    std::vector<std::string> rows;
    for (const std::size_t row : sets.clocks[c].left_out) rows.push_back(six_digits(row));
    if (rows.empty()) continue;
    warnings.push_back("pictures of camera " + recording.cameras()[c].name +
                       " in no frame, since they have no time stamp and nothing else tells their "
                       "moment: " +
                       counted_names(rows));
  }
  return warnings;
}

PackReport pack_recording(const fs::path& frames, const fs::path& out, const PackOptions& options,
                          const Progress& progress) {
  refuse_frames_as_output(frames, out);
  refuse_as_output("--frames", frames, out);
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
  TimeTable times;
  if (!times_file.empty()) {
    times = read_time_table(times_file, report.cameras);
    report.warnings = unmatched_times(times_file, times, found);
    for (const std::string& camera : report.cameras) {
      std::vector<std::int64_t> of_camera;
      for (const std::string& frame : found.names)
        of_camera.push_back(time_of(times, frame, camera));
      auto disorder =
          disorder_warning(camera, of_camera, [&](std::size_t row) { return found.names[row]; });
      if (disorder) report.warnings.push_back(std::move(*disorder));
    }
  }
  if (!found.without_picture.empty())
    report.warnings.push_back(
        "frame folders without a picture, which the recording does not hold: " +
        counted_names(found.without_picture));
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

LostPictures lost_pictures(const Recording& recording, const FrameSets& sets) {
  LostPictures lost(recording.cameras().size());
  for (const FrameSet& set : sets.sets) {
    for (std::size_t c = 0; c < lost.size(); ++c) {
      const auto row = set.rows[c];
      if (row && recording.valid(*row, c) && !is_there(recording, row, c))
        lost[c].push_back(set.number);
    }
  }
  return lost;
}

std::vector<std::string> lost_warnings(const Recording& recording, const LostPictures& lost) {
  std::vector<std::string> warnings;
  for (std::size_t c = 0; c < lost.size(); ++c) {
    std::vector<std::string> names;
    for (const std::size_t number : lost[c]) names.push_back(six_digits(number));
    if (names.empty()) continue;
    warnings.push_back(
        "pictures of camera " + recording.cameras()[c].name +
        " that were recorded and whose files are no longer there: " + counted_names(names));
  }
  return warnings;
}

PackReport unpack_recording(const Recording& recording, const FrameSets& sets, const fs::path& out,
                            const Progress& progress) {
  refuse_as_output("--frames", recording.folder(), out);
  refuse_what_would_stay(recording, sets, out);
  // Fewer frames, without their times, would be a sequence like any other: a new folder appears
  // whole.
  std::optional<ReplacingFolder> making;
  if (!fs::exists(out)) making.emplace(out);
  const fs::path folder = making ? making->path() : out;
  fs::create_directories(folder);
  PackReport report;
  report.frames = sets.sets.size();
  for (const RecordedCamera& camera : recording.cameras()) report.cameras.push_back(camera.name);
  std::atomic<std::size_t> pictures{0};
  std::mutex telling;
  std::size_t done = 0;  // guarded by `telling`
  const std::size_t cameras = recording.cameras().size();
  parallel_for(sets.sets.size(), [&](std::size_t k) {
    const std::string name = six_digits(sets.sets[k].number);
    fs::create_directories(folder / name);
    for (std::size_t c = 0; c < cameras; ++c) {
      const auto row = sets.sets[k].rows[c];
      const cv::Mat image = row ? recording.read(*row, c) : cv::Mat();
      if (image.empty()) continue;
      write_image(folder / name / (recording.cameras()[c].name + ".png"), image,
                  recording.cameras()[c].bit_depth);
      ++pictures;
    }
    if (!progress) return;
    const std::lock_guard lock(telling);
    progress("unpacking", static_cast<double>(++done) / static_cast<double>(report.frames));
  });
  report.pictures = pictures;
  report.missing = report.frames * cameras - report.pictures;
  report.warnings = recording_warnings(recording, sets);
  for (std::string& warning : lost_warnings(recording, lost_pictures(recording, sets)))
    report.warnings.push_back(std::move(warning));
  if (has_times(recording, sets)) write_text(folder / kTimesFile, table_of_times(recording, sets));
  if (making) making->publish();
  return report;
}

}  // namespace pencilscan
