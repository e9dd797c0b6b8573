#include "pencilscan/recording/recording_writer.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <mutex>
#include <set>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/recording/layout.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// Rows of time stamps and validity in one chunk of one camera: 36 kilobytes that are written anew
/// with every picture. So kMostFrames of 256 cameras, the most that a rig has, are 625,152 chunks;
/// of more than a million a table is not read (io/zarr_array.cpp).
constexpr std::int64_t kTableRows = 4096;
/// Rows by which the arrays grow: so many pictures of a camera cost one more `.zarray` each.
constexpr std::int64_t kGrowth = 1024;

template <class Number>
std::span<const std::uint8_t> as_bytes_of(std::span<const Number> numbers) {
  return {reinterpret_cast<const std::uint8_t*>(numbers.data()), numbers.size_bytes()};
}

}  // namespace

void check_recorded(const fs::path& folder, const std::vector<RecordedCamera>& cameras,
                    OutFolder out) {
  const bool is_free = !fs::exists(folder) || (fs::is_directory(folder) && fs::is_empty(folder));
  if (out == OutFolder::kNew && !is_free)
    throw InputError(folder.string(), "", "", "must be new or an empty folder");
  std::set<std::string> names = {kTimestampArray, kValidArray};
  for (const RecordedCamera& camera : cameras) {
    const bool is_name =
        !camera.name.empty() && camera.name[0] != '.' && camera.name.find('/') == std::string::npos;
    if (!is_name || !names.insert(camera.name).second) {
      throw InputError(folder.string(), "cameras", camera.name,
                       "must name a folder, each another one, and not " +
                           std::string(kTimestampArray) + " or " + kValidArray);
    }
  }
}

struct RecordingWriter::State {
  /// Times and validity of one camera, written by its thread alone.
  struct Column {
    std::vector<std::int64_t> times;
    std::vector<std::uint8_t> valid;
  };

  fs::path folder;
  std::vector<RecordedCamera> cameras;
  std::vector<ZarrArray> pictures;
  ZarrArray times;
  ZarrArray valid;
  std::vector<Column> columns;
  nlohmann::ordered_json attributes;
  std::mutex growing;
  std::int64_t capacity = 0;  ///< rows that the arrays state; guarded by `growing`
  std::size_t rows = 0;       ///< rows written to; guarded by `growing`
  bool closed = false;

  void write_shapes(std::int64_t count, Durability durability) {
    capacity = count;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      ZarrArray array = pictures[c];
      array.shape[0] = count;
      write_zarr_array(folder / cameras[c].name, array, durability);
    }
    for (const auto& [array, name] : {std::pair{&times, kTimestampArray}, {&valid, kValidArray}}) {
      array->shape[0] = count;
      write_zarr_array(folder / name, *array, durability);
    }
  }

  void write_attributes(bool is_open) {
    nlohmann::ordered_json all = attributes;
    all["cameras"] = nlohmann::ordered_json::array();
    bool any_exposure = false;
    nlohmann::ordered_json exposures = nlohmann::ordered_json::array();
    for (const RecordedCamera& camera : cameras) {
      all["cameras"].push_back(camera.name);
      exposures.push_back(camera.exposure_us);
      any_exposure = any_exposure || camera.exposure_us > 0;
    }
    if (any_exposure) all[kExposureAttribute] = exposures;
    if (is_open) all[kOpenAttribute] = true;
    write_zarr_group(folder, all);
  }

  /// What cannot be read is not written.
  void check_row(std::size_t row) const {
    if (row < static_cast<std::size_t>(kMostFrames)) return;
    throw StageError(folder.string() + ": the recording is full: it has at most " +
                     std::to_string(kMostFrames) + " frames");
  }

  /// Makes the arrays state at least row + 1 rows.
  void reach(std::size_t row) {
    const std::lock_guard lock(growing);
    rows = std::max(rows, row + 1);
    if (static_cast<std::int64_t>(rows) <= capacity) return;
    write_shapes((static_cast<std::int64_t>(row) / kGrowth + 1) * kGrowth, Durability::kProcess);
  }

  void note(std::size_t row, std::size_t camera, std::int64_t time, bool is_valid) {
    reach(row);
    Column& column = columns[camera];
    const auto chunk_rows = static_cast<std::size_t>(kTableRows);
    const std::size_t chunk = row / chunk_rows;
    if (column.times.size() < (chunk + 1) * chunk_rows) {
      column.times.resize((chunk + 1) * chunk_rows, kUnknownTime);
      column.valid.resize((chunk + 1) * chunk_rows, 0);
    }
    column.times[row] = time;
    column.valid[row] = is_valid ? 1 : 0;
    const std::int64_t index[] = {static_cast<std::int64_t>(chunk),
                                  static_cast<std::int64_t>(camera)};
    const std::span all_times(column.times);
    const std::span all_valid(column.valid);
    write_zarr_chunk(folder / kTimestampArray, times, index,
                     as_bytes_of<std::int64_t>(all_times.subspan(chunk * chunk_rows, chunk_rows)),
                     Durability::kProcess);
    write_zarr_chunk(folder / kValidArray, valid, index,
                     as_bytes_of<std::uint8_t>(all_valid.subspan(chunk * chunk_rows, chunk_rows)),
                     Durability::kProcess);
  }
};

RecordingWriter::RecordingWriter(const fs::path& folder, std::vector<RecordedCamera> cameras,
                                 const RecordingOptions& options)
    : state_(std::make_unique<State>()) {
  PENCILSCAN_CHECK(!cameras.empty());
  check_recorded(folder, cameras, OutFolder::kNew);
  State& state = *state_;
  state.folder = folder;
  state.attributes = options.attributes;
  for (const RecordedCamera& camera : cameras) {
    PENCILSCAN_CHECK(camera.width > 0 && camera.height > 0);
    PENCILSCAN_CHECK(camera.channels == 1 || camera.channels == 3);
    PENCILSCAN_CHECK(camera.bit_depth == 8 || camera.bit_depth == 16);
    ZarrArray array;
    array.shape = {0, camera.height, camera.width};
    if (camera.channels == 3) array.shape.push_back(3);
    array.chunks = array.shape;
    array.chunks[0] = 1;
    array.type = camera.bit_depth == 8 ? ZarrType::kUint8 : ZarrType::kUint16;
    array.compression = options.compression;
    state.pictures.push_back(array);
  }
  const auto count = static_cast<std::int64_t>(cameras.size());
  state.times.type = ZarrType::kInt64;
  state.times.fill_value = static_cast<double>(kUnknownTime);
  state.times.shape = state.valid.shape = {0, count};
  state.times.chunks = state.valid.chunks = {kTableRows, 1};
  state.columns.resize(cameras.size());
  state.cameras = std::move(cameras);
  state.write_shapes(0, Durability::kDisk);
  state.write_attributes(true);
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::write(std::size_t row, std::size_t camera, const cv::Mat& image,
                            std::int64_t timestamp_ns) {
  State& state = *state_;
  PENCILSCAN_CHECK(!state.closed && camera < state.cameras.size());
  state.check_row(row);
  const RecordedCamera& of = state.cameras[camera];
  PENCILSCAN_CHECK(image.cols == of.width && image.rows == of.height &&
                   image.type() == of.image_type());
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  const ZarrArray& array = state.pictures[camera];
  write_zarr_chunk(state.folder / of.name, array, picture_index(array, row),
                   {whole.data, array.chunk_bytes()}, Durability::kProcess);
  state.note(row, camera, timestamp_ns, true);
}

void RecordingWriter::write_missing(std::size_t row, std::size_t camera,
                                    std::int64_t timestamp_ns) {
  PENCILSCAN_CHECK(!state_->closed && camera < state_->cameras.size());
  state_->check_row(row);
  state_->note(row, camera, timestamp_ns, false);
}

void RecordingWriter::close() {
  State& state = *state_;
  if (state.closed) return;
  state.write_shapes(static_cast<std::int64_t>(state.rows), Durability::kDisk);
  const int folder = ::open(state.folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool flushed = folder >= 0 && ::syncfs(folder) == 0;
  if (folder >= 0) ::close(folder);
  if (!flushed) throw StageError(state.folder.string() + ": the disk did not take the recording");
  state.write_attributes(false);
  state.closed = true;
}

}  // namespace pencilscan
