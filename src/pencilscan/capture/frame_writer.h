#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "pencilscan/capture/camera_group.h"
#include "pencilscan/capture/gathering.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

class RecordingWriter;

/// Writes frames to disk on threads of its own, in the order given.
class FrameWriter {
 public:
  /// `rig`: its cameras in the order of `cameras`; mosaics that it does not state are made colour
  /// (picture_for_files()). `utc_ns`: what to add to a frame's times. `shared_clock`: time stamps
  /// of cameras can be compared.
  FrameWriter(const CameraGroup& cameras, const Rig& rig, const std::filesystem::path& out,
              std::int64_t utc_ns, bool shared_clock);
  ~FrameWriter();
  FrameWriter(const FrameWriter&) = delete;
  FrameWriter& operator=(const FrameWriter&) = delete;

  struct Item {
    GatheredFrame frame;
    std::vector<std::int64_t> times_ns;  ///< per camera, host; -1: no picture
  };
  /// Frames that wait.
  [[nodiscard]] std::size_t waiting();
  void add(Item item);
  /// Waits for all of them; throws what a writing thread threw.
  void finish();

 private:
  struct Row {
    std::shared_ptr<const Item> item;
    std::size_t number = 0;
  };
  void run(std::size_t worker);
  void write(const Row& row, std::size_t camera);
  void rethrow();

  const CameraGroup& cameras_;
  std::vector<Camera> described_;  ///< the rig's
  std::filesystem::path out_;
  std::int64_t utc_ns_;
  std::unique_ptr<RecordingWriter> zarr_;  ///< null: image folders
  std::vector<int> types_;                 ///< per camera, of the recording
  std::vector<cv::Size> sizes_;
  std::size_t rows_ = 0;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::deque<Row>> queues_;  ///< per worker; a camera belongs to one of them
  bool ending_ = false;
  std::exception_ptr failure_;
  std::vector<std::thread> workers_;
};

}  // namespace pencilscan
