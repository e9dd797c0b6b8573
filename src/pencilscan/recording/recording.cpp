#include "pencilscan/recording/recording.h"

#include <algorithm>
#include <cstring>
#include <optional>

#include "pencilscan/core/error.h"
#include "pencilscan/recording/layout.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::vector<std::string> camera_names(const fs::path& folder, const json& attributes) {
  const std::string file = (folder / ".zattrs").string();
  const json list = attributes.value("cameras", json());
  if (!list.is_array() || list.empty())
    throw InputError(file, "cameras", "", "must be the list of the cameras' names");
  std::vector<std::string> names;
  for (const json& entry : list) {
    const std::string name = entry.is_string() ? entry.get<std::string>() : "";
    const bool is_name = !name.empty() && name.find('/') == std::string::npos && name[0] != '.' &&
                         name != kTimestampArray && name != kValidArray;
    if (!is_name) throw InputError(file, "cameras", entry.dump(), "must be the name of a camera");
    if (std::find(names.begin(), names.end(), name) != names.end())
      throw InputError(file, "cameras", name, "must be named once");
    names.push_back(name);
  }
  return names;
}

RecordedCamera camera_of(const fs::path& folder, const std::string& name, const ZarrArray& array) {
  const std::string file = (folder / name / ".zarray").string();
  const std::vector<std::int64_t>& shape = array.shape;
  const bool is_color = shape.size() == 4 && shape[3] == 3;
  if (!is_color && shape.size() != 3) {
    throw InputError(file, "shape", json(shape).dump(),
                     "must be [frame, height, width] or [frame, height, width, 3]");
  }
  constexpr std::int64_t kMaxSize = 1 << 16;
  if (shape[1] < 1 || shape[2] < 1 || shape[1] > kMaxSize || shape[2] > kMaxSize)
    throw InputError(file, "shape", json(shape).dump(),
                     "must have a height and a width in 1..65536");
  std::vector<std::int64_t> one_frame = shape;
  one_frame[0] = 1;
  if (array.chunks != one_frame)
    throw InputError(file, "chunks", json(array.chunks).dump(), "must be one frame");
  if (array.type != ZarrType::kUint8 && array.type != ZarrType::kUint16)
    throw InputError(file, "dtype", "", "must be |u1 or <u2");
  RecordedCamera camera;
  camera.name = name;
  camera.height = static_cast<int>(shape[1]);
  camera.width = static_cast<int>(shape[2]);
  camera.channels = is_color ? 3 : 1;
  camera.bit_depth = array.type == ZarrType::kUint8 ? 8 : 16;
  return camera;
}

/// The rows that all arrays state. Those of a recording that is open may differ: a writer that
/// makes them grow does so one after another, and may end between two of them. What the shortest
/// does not state, nothing was written to.
class SharedRows {
 public:
  explicit SharedRows(bool is_closed) : is_closed_(is_closed) {}

  void add(const fs::path& folder, const std::string& name, const ZarrArray& array) {
    const std::string file = (folder / name / ".zarray").string();
    const std::int64_t rows = array.shape[0];
    if (is_closed_ && rows_ && rows != *rows_) {
      throw InputError(file, "shape", json(array.shape).dump(),
                       "must have as many frames as the other arrays, " + std::to_string(*rows_));
    }
    if (rows > kMostFrames) {
      throw InputError(file, "shape", json(array.shape).dump(),
                       "must have at most " + std::to_string(kMostFrames) + " frames");
    }
    rows_ = std::min(rows, rows_.value_or(rows));
  }
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(rows_.value_or(0)); }

 private:
  bool is_closed_;
  std::optional<std::int64_t> rows_;
};

/// A table [frame, camera] of a type; InputError for another.
template <class Number>
ZarrArray open_table(const fs::path& folder, const char* name, std::size_t cameras) {
  ZarrArray array = read_zarr_array(folder / name);
  const std::string file = (folder / name / ".zarray").string();
  if (array.shape.size() != 2 || array.shape[1] != static_cast<std::int64_t>(cameras)) {
    throw InputError(file, "shape", json(array.shape).dump(),
                     "must be frames and cameras, [frame, " + std::to_string(cameras) + "]");
  }
  if (array.type != zarr_type<Number>())
    throw InputError(file, "dtype", "", sizeof(Number) == 1 ? "must be |u1" : "must be <i8");
  return array;
}

/// The first rows of a table that has as many or more.
template <class Number>
std::vector<Number> read_table(const fs::path& folder, const char* name, const ZarrArray& array,
                               std::size_t rows) {
  const std::vector<std::uint8_t> bytes = read_zarr_bytes(folder / name, array);
  std::vector<Number> table(rows * static_cast<std::size_t>(array.shape[1]));
  if (!table.empty()) std::memcpy(table.data(), bytes.data(), table.size() * sizeof(Number));
  return table;
}

/// The attribute `exposure_us`: one number for all cameras, or a list.
void read_exposures(const fs::path& folder, const json& attributes,
                    std::vector<RecordedCamera>& cameras) {
  if (!attributes.contains(kExposureAttribute)) return;
  const json& value = attributes[kExposureAttribute];
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const json one = value.is_array() && value.size() == cameras.size() ? value[c] : value;
    if (!one.is_number() || one.get<double>() < 0) {
      throw InputError((folder / ".zattrs").string(), kExposureAttribute, value.dump(),
                       "must be microseconds >= 0, one number or one per camera");
    }
    cameras[c].exposure_us = one.get<double>();
  }
}

/// An attribute that is true or false; nothing where it is not there.
std::optional<bool> flag_of(const fs::path& folder, const json& attributes, const char* key) {
  if (!attributes.contains(key)) return std::nullopt;
  const json& value = attributes[key];
  if (!value.is_boolean())
    throw InputError((folder / ".zattrs").string(), key, value.dump(), "must be true or false");
  return value.get<bool>();
}

}  // namespace

bool Recording::is_one(const fs::path& folder) { return is_zarr_group(folder); }

Recording Recording::open(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw InputError(folder.string(), "", "", "must be the folder of a recording");
  if (!is_one(folder))
    throw InputError(folder.string(), "", "", "must be a recording: it has no .zgroup");
  Recording recording;
  recording.folder_ = folder;
  recording.attributes_ = read_zarr_group(folder);
  recording.closed_ = !flag_of(folder, recording.attributes_, kOpenAttribute).value_or(false);
  SharedRows rows(recording.closed_);
  for (const std::string& name : camera_names(folder, recording.attributes_)) {
    ZarrArray array = read_zarr_array(folder / name);
    recording.cameras_.push_back(camera_of(folder, name, array));
    rows.add(folder, name, array);
    recording.pictures_.push_back(std::move(array));
  }
  const std::size_t cameras = recording.cameras_.size();
  const ZarrArray times = open_table<std::int64_t>(folder, kTimestampArray, cameras);
  const ZarrArray valid = open_table<std::uint8_t>(folder, kValidArray, cameras);
  rows.add(folder, kTimestampArray, times);
  rows.add(folder, kValidArray, valid);
  recording.rows_ = rows.count();
  recording.timestamps_ = read_table<std::int64_t>(folder, kTimestampArray, times, recording.rows_);
  recording.valid_ = read_table<std::uint8_t>(folder, kValidArray, valid, recording.rows_);
  read_exposures(folder, recording.attributes_, recording.cameras_);
  recording.shares_clock_ = flag_of(folder, recording.attributes_, kSharedClockAttribute);
  if (!recording.closed_) {
    // The arrays are longer than what was written to them.
    while (recording.rows_ > 0) {
      const auto row =
          recording.valid_.begin() + static_cast<std::ptrdiff_t>((recording.rows_ - 1) * cameras);
      if (std::any_of(row, row + static_cast<std::ptrdiff_t>(cameras),
                      [](std::uint8_t v) { return v != 0; }))
        break;
      --recording.rows_;
    }
  }
  return recording;
}

std::optional<std::size_t> Recording::camera_named(const std::string& name) const {
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (cameras_[c].name == name) return c;
  }
  return std::nullopt;
}

fs::path Recording::picture_file(std::size_t row, std::size_t camera) const {
  return folder_ / cameras_[camera].name /
         pictures_[camera].chunk_name(picture_index(pictures_[camera], row));
}

cv::Mat Recording::read(std::size_t row, std::size_t camera) const {
  if (!valid(row, camera)) return {};
  const RecordedCamera& of = cameras_[camera];
  const ZarrArray& array = pictures_[camera];
  const auto bytes = read_zarr_chunk(folder_ / of.name, array, picture_index(array, row));
  if (!bytes) return {};
  cv::Mat image(of.height, of.width, of.image_type());
  std::memcpy(image.data, bytes->data(), bytes->size());
  return image;
}

}  // namespace pencilscan
