#include "pencilscan/pipeline/frame_source.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/pipeline/frame_files.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/recording/frame_sets.h"
#include "pencilscan/recording/pack.h"
#include "pencilscan/recording/recording.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {

namespace fs = std::filesystem;

struct FrameSource::Storage {
  virtual ~Storage() = default;
  /// One image per camera of the rig, empty where there is none.
  [[nodiscard]] virtual std::vector<cv::Mat> images(const Rig& rig, std::size_t frame) const = 0;
  virtual void check(const Rig& rig, std::size_t frame) const = 0;
  [[nodiscard]] virtual std::vector<std::uint64_t> hashes(std::size_t frame) const = 0;
  [[nodiscard]] virtual std::optional<FrameTiming> timing(std::size_t frame) const = 0;
};

struct FrameSource::Folders : Storage {
  std::vector<FrameFiles> frames;

  std::vector<cv::Mat> images(const Rig& rig, std::size_t frame) const override {
    return read_images(rig, frames[frame]);
  }
  void check(const Rig& rig, std::size_t frame) const override {
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      if (const auto& image = frames[frame].images[c]) check_camera_image(rig.cameras[c], *image);
    }
  }
  std::vector<std::uint64_t> hashes(std::size_t frame) const override {
    return file_hashes(frames[frame]);
  }
  std::optional<FrameTiming> timing(std::size_t) const override { return std::nullopt; }
};

struct FrameSource::Recorded : Storage {
  Recorded(Recording opened, FrameSets grouped)
      : recording(std::move(opened)), sets(std::move(grouped)) {}

  Recording recording;
  FrameSets sets;
  std::vector<std::optional<std::size_t>> camera_of;  ///< of the rig's cameras, in the recording

  /// Where the picture of a camera of the rig is.
  [[nodiscard]] std::optional<std::size_t> row(std::size_t frame, std::size_t c) const {
    return camera_of[c] ? sets.sets[frame].rows[*camera_of[c]] : std::nullopt;
  }
  std::vector<cv::Mat> images(const Rig& rig, std::size_t frame) const override {
    std::vector<cv::Mat> result(rig.cameras.size());
    for (std::size_t c = 0; c < result.size(); ++c) {
      const auto at = row(frame, c);
      if (!at) continue;
      result[c] = recording.read(*at, *camera_of[c]);
      if (!result[c].empty())
        check_channels(rig.cameras[c], result[c].channels(),
                       recording.picture_file(*at, *camera_of[c]));
    }
    return result;
  }
  void check(const Rig& rig, std::size_t frame) const override {
    static_cast<void>(images(rig, frame));
  }
  std::vector<std::uint64_t> hashes(std::size_t frame) const override {
    std::vector<std::uint64_t> hashes;
    for (std::size_t c = 0; c < camera_of.size(); ++c) {
      const auto at = row(frame, c);
      const fs::path file = at ? recording.picture_file(*at, *camera_of[c]) : fs::path();
      std::error_code ignored;
      hashes.push_back(at && fs::exists(file, ignored) ? hash_bytes(read_file(file)) : 0);
    }
    return hashes;
  }
  std::optional<FrameTiming> timing(std::size_t frame) const override {
    const FrameSet& set = sets.sets[frame];
    FrameTiming timing;
    bool any = false;
    for (const auto& camera : camera_of) {
      const bool timed = camera && sets.clocks[*camera].timed && set.rows[*camera];
      any = any || timed;
      timing.offset_us.push_back(timed ? set.offset_ns[*camera] / 1000 : 0);
      timing.is_late.push_back(timed && sets.clocks[*camera].limit_ns > 0 &&
                               std::abs(set.offset_ns[*camera]) > sets.clocks[*camera].limit_ns);
    }
    timing.spread_us = set.spread_ns / 1000;
    if (!any) return std::nullopt;
    return timing;
  }
};

FrameSource FrameSource::open(const Rig& rig, const fs::path& path) {
  FrameSource source;
  if (!Recording::is_one(path)) {
    auto folders = std::make_shared<Folders>();
    folders->frames = find_frames(rig, path);
    std::set<std::string> strangers;
    for (const FrameFiles& files : folders->frames) {
      source.names_.push_back(files.name);
      strangers.insert(files.strangers.begin(), files.strangers.end());
    }
    source.strangers_.assign(strangers.begin(), strangers.end());
    source.storage_ = std::move(folders);
    return source;
  }
  Recording recording = Recording::open(path);
  source.closed_ = recording.is_closed();
  FrameSets sets = group_frames(recording);
  source.left_out_ = recording_warnings(recording, sets);
  auto recorded = std::make_shared<Recorded>(std::move(recording), std::move(sets));
  bool any = false;
  for (const Camera& camera : rig.cameras) {
    const auto c = recorded->recording.camera_named(camera.name);
    recorded->camera_of.push_back(c);
    if (!c) continue;
    any = true;
    const RecordedCamera& of = recorded->recording.cameras()[*c];
    if (of.width != camera.width || of.height != camera.height) {
      throw InputError((path / camera.name / ".zarray").string(), "shape",
                       std::to_string(of.width) + "x" + std::to_string(of.height),
                       "must be " + std::to_string(camera.width) + "x" +
                           std::to_string(camera.height) + " as camera " + camera.name +
                           " of the rig");
    }
  }
  for (const RecordedCamera& of : recorded->recording.cameras()) {
    const bool is_known = std::any_of(rig.cameras.begin(), rig.cameras.end(),
                                      [&](const Camera& camera) { return camera.name == of.name; });
    if (!is_known) source.strangers_.push_back(of.name);
  }
  std::sort(source.strangers_.begin(), source.strangers_.end());
  if (!any) {
    throw InputError(path.string(), "cameras", "none of the rig",
                     "must hold a camera of the rig (" + camera_names(rig) + ")");
  }
  if (recorded->sets.sets.empty())
    throw InputError(path.string(), "frames", "none", "must hold at least one frame");
  for (const FrameSet& set : recorded->sets.sets) source.names_.push_back(six_digits(set.number));
  source.storage_ = std::move(recorded);
  return source;
}

void FrameSource::add_plain(const Rig& rig, const fs::path& path) {
  auto plain = std::make_shared<FrameSource>(open(rig, path));
  for (const std::string& name : names_) {
    const auto own = std::find(plain->names_.begin(), plain->names_.end(), name);
    if (own == plain->names_.end() && plain->size() > 1) {
      throw InputError(path.string(), "frames", std::to_string(plain->size()),
                       "must hold one named " + name + ", or one in all");
    }
    plain_of_.push_back(
        own == plain->names_.end() ? 0 : static_cast<std::size_t>(own - plain->names_.begin()));
  }
  plain_ = std::move(plain);
}

Frame FrameSource::read(const Rig& rig, std::size_t frame) const {
  Frame result;
  result.name = names_[frame];
  result.images = storage_->images(rig, frame);
  result.timing = storage_->timing(frame);
  if (plain_) result.plain = plain_->storage_->images(rig, plain_of_[frame]);
  return result;
}

void FrameSource::check(const Rig& rig, std::size_t frame) const {
  storage_->check(rig, frame);
  if (plain_) plain_->storage_->check(rig, plain_of_[frame]);
}

std::vector<std::uint64_t> FrameSource::picture_hashes(std::size_t frame) const {
  return storage_->hashes(frame);
}

std::uint64_t FrameSource::hash(std::size_t frame,
                                const std::vector<std::uint64_t>& pictures) const {
  std::uint64_t hash = hash_bytes(names_[frame]);
  for (const std::uint64_t picture : pictures) hash = hash_bytes(hex(picture), hash);
  if (!plain_) return hash;
  for (const std::uint64_t picture : plain_->picture_hashes(plain_of_[frame]))
    hash = hash_bytes(hex(picture), hash);
  return hash;
}

}  // namespace pencilscan
