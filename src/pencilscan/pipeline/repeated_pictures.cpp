#include "pencilscan/pipeline/repeated_pictures.h"

#include <algorithm>

namespace pencilscan {

std::vector<RepeatedPicture> repeated_pictures(std::span<const std::vector<std::uint64_t>> hashes) {
  std::vector<RepeatedPicture> found;
  for (std::size_t i = 1; i < hashes.size(); ++i) {
    const std::vector<std::uint64_t>& before = hashes[i - 1];
    const std::vector<std::uint64_t>& now = hashes[i];
    if (before.size() != now.size()) continue;
    bool any_changed = false;
    for (std::size_t c = 0; c < now.size(); ++c)
      any_changed = any_changed || (now[c] != 0 && before[c] != 0 && now[c] != before[c]);
    if (!any_changed) continue;
    for (std::size_t c = 0; c < now.size(); ++c) {
      if (now[c] == 0 || now[c] != before[c]) continue;
      const auto run = std::find_if(found.begin(), found.end(), [&](const RepeatedPicture& r) {
        return r.camera == c && r.last + 1 == i;
      });
      if (run != found.end()) {
        run->last = i;
      } else {
        found.push_back({c, i - 1, i});
      }
    }
  }
  return found;
}

std::string describe_repeated(const std::string& camera, const std::string& first,
                              const std::string& last) {
  return "camera " + camera + " has the same picture in frames " + first + " to " + last +
         ", while others changed: it hangs, or the file was copied";
}

}  // namespace pencilscan
