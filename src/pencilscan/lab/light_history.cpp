#include "pencilscan/lab/light_history.h"

#include <algorithm>
#include <cstring>

namespace pencilscan {
namespace {

constexpr std::int64_t kKeptNs = 1'000'000'000;

bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

}  // namespace

void LightHistory::add(std::int64_t time_ns, const cv::Mat& picture) {
  Picture shown;
  for (const Entry& entry : entries_)
    if (same_bytes(*entry.picture, picture)) shown = entry.picture;
  if (!shown) shown = std::make_shared<const cv::Mat>(picture.clone());
  while (entries_.size() > 1 && entries_[1].time_ns < time_ns - kKeptNs) entries_.pop_front();
  entries_.push_back({time_ns, std::move(shown)});
}

std::vector<LightHistory::Part> LightHistory::during(std::int64_t begin_ns,
                                                     std::int64_t end_ns) const {
  std::vector<Part> parts;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    // The first picture stands for all time before it.
    const std::int64_t from = i == 0 ? begin_ns : std::max(begin_ns, entries_[i].time_ns);
    const std::int64_t to =
        i + 1 < entries_.size() ? std::min(end_ns, entries_[i + 1].time_ns) : end_ns;
    if (from >= to) continue;
    const double share = static_cast<double>(to - from) / static_cast<double>(end_ns - begin_ns);
    parts.push_back({entries_[i].picture, share});
  }
  return parts;
}

}  // namespace pencilscan
