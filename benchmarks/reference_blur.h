#pragma once

#include <functional>

namespace pencilscan {

/// How machines are made comparable: the time of a step for one frame of six 1280x960 colour images
/// is quoted as "blur ratio", a multiple of the time of cv::GaussianBlur 5x5 (sigma 1.1) on those
/// six images as float with three channels, on one OpenCV thread. Both are measured in one process.

/// Fewest runs that a quoted median may rest on.
inline constexpr int kBenchmarkRuns = 7;

/// Median wall-clock seconds of `runs` calls of `step`, after one call that is not counted. runs
/// >= 1.
[[nodiscard]] double median_seconds(const std::function<void()>& step, int runs = kBenchmarkRuns);

/// Median seconds of the reference blur of one frame. OpenCV's thread count is as before
/// afterwards.
[[nodiscard]] double reference_blur_seconds(int runs = kBenchmarkRuns);

}  // namespace pencilscan
