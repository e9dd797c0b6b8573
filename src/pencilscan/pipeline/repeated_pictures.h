#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace pencilscan {

/// A camera that gave one picture in several frames, `first` to `last` of a list.
struct RepeatedPicture {
  std::size_t camera = 0;
  std::size_t first = 0;
  std::size_t last = 0;
};

/// Cameras that hung: their picture is byte for byte that of the frame before while another
/// camera's is not. No sensor gives the same noise twice; where all repeat theirs, the frame was
/// copied or simulated without noise, and each is right by itself. `hashes`: of each frame in order
/// the picture of every camera, 0 where there is none. Runs of frames, by first frame and camera.
[[nodiscard]] std::vector<RepeatedPicture> repeated_pictures(
    std::span<const std::vector<std::uint64_t>> hashes);

/// One sentence for the user.
[[nodiscard]] std::string describe_repeated(const std::string& camera, const std::string& first,
                                            const std::string& last);

}  // namespace pencilscan
