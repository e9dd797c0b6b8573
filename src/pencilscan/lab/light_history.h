#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

namespace pencilscan {

/// What a projector was told to show, over time; the last second is kept.
class LightHistory {
 public:
  using Picture = std::shared_ptr<const cv::Mat>;

  /// From `time_ns` on; times do not go back. A picture that equals one still kept is that one.
  void add(std::int64_t time_ns, const cv::Mat& picture);

  /// A picture with the share of the time that it was shown.
  struct Part {
    Picture picture;
    double share = 0;
  };
  /// What was shown from begin to end, begin < end; empty before the first picture.
  [[nodiscard]] std::vector<Part> during(std::int64_t begin_ns, std::int64_t end_ns) const;

 private:
  struct Entry {
    std::int64_t time_ns = 0;
    Picture picture;
  };
  std::deque<Entry> entries_;  ///< by time
};

}  // namespace pencilscan
