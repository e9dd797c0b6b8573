#pragma once

#include <cstdint>
#include <vector>

#include "pencilscan/io/zarr_array.h"

namespace pencilscan {

// Names inside recording.zarr that reader and writer share.
inline constexpr const char* kTimestampArray = "timestamp_ns";
inline constexpr const char* kValidArray = "valid";
inline constexpr const char* kExposureAttribute = "exposure_us";
inline constexpr const char* kSharedClockAttribute = "shared_clock";
inline constexpr const char* kOpenAttribute = "is_open";  ///< true until the writer closes

/// Frames of one recording: days at 30 frames a second. What is known of each takes memory, whether
/// its pictures are there or not.
inline constexpr std::int64_t kMostFrames = 10'000'000;

/// The chunk of one picture.
[[nodiscard]] inline std::vector<std::int64_t> picture_index(const ZarrArray& pictures,
                                                             std::size_t row) {
  std::vector<std::int64_t> index(pictures.shape.size(), 0);
  index[0] = static_cast<std::int64_t>(row);
  return index;
}

}  // namespace pencilscan
