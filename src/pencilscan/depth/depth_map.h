#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "pencilscan/geometry/types.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// Why a node of a depth map has no depth, or kMeasured.
enum class HoleReason : std::uint8_t {
  kBackground,     ///< off the object: nothing is missing here
  kMeasured,       ///< depth is there
  kNoProjector,    ///< no projector's lines are to be seen
  kOneProjector,   ///< one projector only, and its lines do not fix the depth well enough
  kTooCompressed,  ///< lines closer together than the camera resolves
  kAmbiguous,      ///< lines are seen, but which ones they are was not decided
  kContradicted,   ///< a depth was found that other views prove wrong
  kSaturated,      ///< too many pixels are overexposed
  kNotSeen,        ///< of mesh vertices: no camera looks there
};
inline constexpr std::size_t kHoleReasons = 9;

/// One bit per pattern of the rig, in the order of the families.
using LitPatterns = std::bitset<kMostPatterns>;

/// Sets of patterns, each kept once: the nodes of a map are lit by few different ones.
class LitSets {
 public:
  /// Where a set is kept, from now on if it was not.
  [[nodiscard]] std::uint32_t place_of(const LitPatterns& set) {
    const auto [at, is_new] = places_.try_emplace(set, static_cast<std::uint32_t>(sets_.size()));
    if (is_new) sets_.push_back(set);
    return at->second;
  }
  [[nodiscard]] const LitPatterns& operator[](std::uint32_t place) const { return sets_[place]; }

 private:
  std::vector<LitPatterns> sets_ = {LitPatterns()};
  std::unordered_map<LitPatterns, std::uint32_t> places_ = {{LitPatterns(), 0}};
};

/// One measured pixel: inverse depth and its first derivatives, w(u + dx, v + dy) =
/// w + wx dx + wy dy + (wxx dx^2 + 2 wxy dx dy + wyy dy^2) / 2.
struct DepthNode {
  float w = 0;  ///< 1 / camera z, 1/mm; 0: no depth
  float wx = 0, wy = 0, wxx = 0, wxy = 0, wyy = 0;
  float sigma = 0;        ///< mm of camera z, one standard deviation
  float misfit = 0;       ///< chi^2 per degree of freedom (1 = only noise)
  float support = 0;      ///< number of other cameras that agree, each by its own confidence
  float confidence = 0;   ///< 0..1: what the other views say
  std::uint32_t lit = 0;  ///< whose light was found: place in the map's sets
  /// Started from a labelled curve of a pattern found here, not from neighbours.
  bool seeded = false;
  bool cut = false;  ///< a side of its window was left out
  HoleReason reason = HoleReason::kBackground;

  [[nodiscard]] bool measured() const { return w > 0; }
};

/// Depth of one camera on a regular grid of pixels (column * stride, row * stride).
struct DepthMap {
  int camera = 0;
  int stride = 4;
  int columns = 0;
  int rows = 0;
  std::vector<DepthNode> nodes;  ///< rows x columns
  LitSets lit_sets;

  [[nodiscard]] const LitPatterns& lit(const DepthNode& node) const { return lit_sets[node.lit]; }
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] Vec2 pixel(std::size_t node) const {
    const auto width = static_cast<std::size_t>(columns);
    return {static_cast<double>(node % width) * stride, static_cast<double>(node / width) * stride};
  }
};

}  // namespace pencilscan
