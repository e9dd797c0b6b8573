#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/recording/recording.h"

namespace pencilscan {

struct RecordingOptions {
  ZarrCompression compression = ZarrCompression::kLz4;  ///< kZstd: a fifth smaller, seven times
                                                        ///< slower to write
  nlohmann::ordered_json attributes = nlohmann::ordered_json::object();  ///< free, of the group
};

/// What may be where a recording is made: nothing, or an earlier one that it replaces.
enum class OutFolder : std::uint8_t { kNew, kReplaced };

/// InputError where `folder` is there already and not empty (of kNew), or a camera's name is no
/// file name.
void check_recorded(const std::filesystem::path& folder, const std::vector<RecordedCamera>& cameras,
                    OutFolder out);

/// Writes recording.zarr while cameras deliver. Pictures that were written stay readable whatever
/// happens to the program (kill -9): a picture counts from the moment its row says that it is
/// valid, which comes last. One thread per camera may write at a time.
class RecordingWriter {
 public:
  /// Makes the folder; InputError as check_recorded() of a new one.
  RecordingWriter(const std::filesystem::path& folder, std::vector<RecordedCamera> cameras,
                  const RecordingOptions& options = {});
  /// Leaves the recording open where close() was not called.
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// A picture of the camera's size and type (RecordedCamera::image_type, RGB), and when its
  /// exposure began by the camera's clock, or kUnknownTime. Rows may come in any order, each once;
  /// what is never written is a missing picture. StageError when the disk is full, or the row is
  /// beyond the 10,000,000 that a recording has.
  void write(std::size_t row, std::size_t camera, const cv::Mat& image, std::int64_t timestamp_ns);
  /// A picture that the camera announced but did not deliver whole: its time alone.
  void write_missing(std::size_t row, std::size_t camera, std::int64_t timestamp_ns);

  /// States the number of rows and waits for the disk. No thread may be writing.
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
