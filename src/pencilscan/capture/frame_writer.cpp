#include "pencilscan/capture/frame_writer.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pencilscan/capture/camera_picture.h"
#include "pencilscan/capture/sensor_pixels.h"
#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/recording/frame_folders.h"
#include "pencilscan/recording/recording_writer.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

bool is_zarr(const fs::path& out) { return out.extension() == ".zarr"; }

/// What the camera's settings let expect of its pictures.
RecordedCamera expected(const CameraGroup& cameras, std::size_t c, const Camera& described) {
  const CameraSettings settings = cameras.settings(c);
  const auto layout = layout_from_genicam(settings.pixel_format.value_or(""));
  RecordedCamera camera;
  camera.name = cameras.name(c);
  camera.width = settings.width;
  camera.height = settings.height;
  camera.channels = channels_for_files(described, settings);
  camera.bit_depth = layout && layout->bits > 8 ? 16 : 8;
  camera.exposure_us = settings.exposure_us.value_or(0);
  return camera;
}

std::string layout_text(const cv::Mat& picture) {
  return size_text(picture.cols, picture.rows) + " px of " + std::to_string(picture.channels()) +
         (picture.channels() == 1 ? " channel" : " channels") + " and " +
         std::to_string(8 * picture.elemSize1()) + " bits";
}

nlohmann::ordered_json attributes_of(const CameraGroup& cameras, bool shared_clock) {
  nlohmann::ordered_json all;
  all["shared_clock"] = shared_clock;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const CameraSettings settings = cameras.settings(c);
    nlohmann::ordered_json device;
    device["device"] = cameras.info(c).address;
    device["model"] = cameras.info(c).model;
    device["serial"] = cameras.info(c).serial;
    if (settings.pixel_format) device["pixel_format"] = *settings.pixel_format;
    if (settings.gain) device["gain"] = *settings.gain;
    all["devices"][cameras.name(c)] = device;
  }
  return all;
}

}  // namespace

FrameWriter::FrameWriter(const CameraGroup& cameras, const Rig& rig, const fs::path& out,
                         std::int64_t utc_ns, bool shared_clock)
    : cameras_(cameras), described_(rig.cameras), out_(bare_folder(out)), utc_ns_(utc_ns) {
  PENCILSCAN_CHECK(rig.cameras.size() == cameras.size());
  if (fs::exists(out) && !(fs::is_directory(out) && fs::is_empty(out)))
    throw InputError("--out", "", out.string(), "must be new or an empty folder");
  if (is_zarr(out_)) {
    std::vector<RecordedCamera> recorded;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      recorded.push_back(expected(cameras, c, described_[c]));
      types_.push_back(recorded.back().image_type());
      sizes_.emplace_back(recorded.back().width, recorded.back().height);
    }
    RecordingOptions options;
    options.attributes = attributes_of(cameras, shared_clock);
    zarr_ = std::make_unique<RecordingWriter>(out_, std::move(recorded), options);
  } else {
    fs::create_directories(out_);
  }
  const auto count =
      std::min<std::size_t>(cameras.size(), static_cast<std::size_t>(thread_count()));
  queues_.resize(std::max<std::size_t>(1, count));
  for (std::size_t w = 0; w < queues_.size(); ++w) workers_.emplace_back([this, w] { run(w); });
}

FrameWriter::~FrameWriter() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& worker : workers_)
    if (worker.joinable()) worker.join();
}

std::size_t FrameWriter::waiting() {
  const std::lock_guard lock(mutex_);
  std::size_t most = 0;
  for (const auto& queue : queues_) most = std::max(most, queue.size());
  return most;
}

void FrameWriter::rethrow() {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

void FrameWriter::add(Item item) {
  rethrow();
  const Row row{std::make_shared<const Item>(std::move(item)), rows_++};
  {
    const std::lock_guard lock(mutex_);
    for (auto& queue : queues_) queue.push_back(row);
  }
  changed_.notify_all();
}

void FrameWriter::write(const Row& row, std::size_t camera) {
  const auto& frame = row.item->frame.frames[camera];
  const std::int64_t time = row.item->times_ns[camera];
  const std::int64_t utc = time < 0 ? -1 : time + utc_ns_;
  if (!frame) {
    if (zarr_) zarr_->write_missing(row.number, camera, utc);
    return;
  }
  const cv::Mat picture = picture_for_files(described_[camera], *frame);
  if (!zarr_) {
    write_image(out_ / six_digits(row.number) / (cameras_.name(camera) + ".png"), picture);
    return;
  }
  if (picture.type() != types_[camera] || picture.size() != sizes_[camera])
    throw StageError(cameras_.name(camera) + ": its pictures are " + layout_text(picture) +
                     ", and the recording was begun for " +
                     layout_text(cv::Mat(sizes_[camera], types_[camera], cv::Scalar())) +
                     ": state its pixel_format, or record into a folder");
  zarr_->write(row.number, camera, picture, utc);
}

void FrameWriter::run(std::size_t worker) {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ending_ || !queues_[worker].empty(); });
    if (queues_[worker].empty()) return;
    const Row row = queues_[worker].front();
    const bool failed = failure_ != nullptr;
    lock.unlock();
    try {
      for (std::size_t c = worker; !failed && c < cameras_.size(); c += queues_.size())
        write(row, c);
      lock.lock();
    } catch (...) {
      lock.lock();
      if (!failure_) failure_ = std::current_exception();
    }
    queues_[worker].pop_front();  // only now: what waits includes what is being written
  }
}

void FrameWriter::finish() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& worker : workers_)
    if (worker.joinable()) worker.join();
  rethrow();
  if (zarr_) zarr_->close();
}

}  // namespace pencilscan
