#include "pencilscan/depth/pruning.h"

#include <span>
#include <vector>

#include "pencilscan/core/chunks.h"

namespace pencilscan {
namespace {

/// Lit by one projector and confirmed by no camera.
bool is_unconfirmed(const DepthMap& map, const DepthNode& n) {
  return n.measured() && map.lit(n).count() <= 1 && n.support <= 0.01F;
}

/// Removes nodes of a map; returns how many.
std::size_t drop_nodes(std::span<const std::size_t> nodes, HoleReason reason, DepthMap& map) {
  for (const std::size_t k : nodes) {
    map.nodes[k].w = 0;
    map.nodes[k].reason = reason;
  }
  return nodes.size();
}

/// drop(patch) for each set of nodes that are `members` and continue each other's surface; may
/// remove the patch's nodes.
template <class IsMember, class Drop>
void for_each_patch(const DepthMap& map, IsMember is_member, Drop drop) {
  std::vector<char> seen(map.nodes.size(), 0);
  std::vector<std::size_t> patch;
  const auto add = [&](std::size_t i) {
    if (seen[i] || !is_member(map.nodes[i])) return;
    seen[i] = 1;
    patch.push_back(i);
  };
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    patch.clear();
    add(i);
    for (std::size_t k = 0; k < patch.size(); ++k) for_each_neighbor(map, patch[k], 1, add);
    if (!patch.empty()) drop(std::span<const std::size_t>(patch));
  }
}

// Of eight neighbours. On the rendered bunny nearly all errors above 1 mm were nodes without them
// (docs/depth.md, "Agreement"); no fit of this, nor of what drop_lone_nodes() asks for, is kept.
constexpr int kLeastNeighbors = 3;

/// Removes unconfirmed nodes for which is_lone(node, number of neighbours that it continues into).
template <class IsLone>
std::size_t drop_lone(DepthMap& map, IsLone is_lone) {
  std::vector<char> drops(map.nodes.size(), 0);
  parallel_chunks(drops.size(), [&](std::size_t i) {
    const DepthNode& n = map.nodes[i];
    if (!is_unconfirmed(map, n)) return;
    int neighbors = 0;
    for_each_neighbor(map, i, 1, [&](std::size_t) { ++neighbors; });
    drops[i] = is_lone(n, neighbors) ? 1 : 0;
  });
  std::vector<std::size_t> lone;
  for (std::size_t i = 0; i < drops.size(); ++i) {
    if (drops[i] != 0) lone.push_back(i);
  }
  return drop_nodes(lone, HoleReason::kOneProjector, map);
}

}  // namespace

std::size_t drop_lone_nodes(DepthMap& map) {
  constexpr int kLeastNeighborsGrown = 7;
  constexpr float kMisfit = 2.5F;  // 1 where only noise is left
  return drop_lone(map, [](const DepthNode& n, int neighbors) {
    const int least = n.seeded ? kLeastNeighbors : kLeastNeighborsGrown;
    return neighbors < least || n.misfit > kMisfit;
  });
}

std::size_t drop_lone_guided_nodes(DepthMap& map) {
  return drop_lone(map,
                   [](const DepthNode&, int neighbors) { return neighbors < kLeastNeighbors; });
}

std::size_t drop_unconfirmed_patches(DepthMap& map) {
  // Chosen; no fit of the two is kept.
  constexpr double kLeastSeeded = 0.02;      // share of the nodes
  constexpr double kLeastConfidence = 0.75;  // mean; 1 where nothing contradicts
  std::size_t dropped = 0;
  const auto is_member = [&](const DepthNode& n) { return is_unconfirmed(map, n); };
  for_each_patch(map, is_member, [&](std::span<const std::size_t> patch) {
    double seeds = 0;
    double confidence = 0;
    for (const std::size_t k : patch) {
      seeds += map.nodes[k].seeded ? 1 : 0;
      confidence += static_cast<double>(map.nodes[k].confidence);
    }
    const auto size = static_cast<double>(patch.size());
    if (seeds < kLeastSeeded * size || confidence < kLeastConfidence * size)
      dropped += drop_nodes(patch, HoleReason::kOneProjector, map);
  });
  return dropped;
}

std::size_t drop_islands(int min_nodes, DepthMap& map) {
  constexpr float kConfirmed = 0.5F;  // another camera agrees that is believed by half
  std::size_t dropped = 0;
  const auto is_measured = [](const DepthNode& n) { return n.measured(); };
  for_each_patch(map, is_measured, [&](std::span<const std::size_t> island) {
    std::size_t confirmed = 0;
    std::size_t seeds = 0;
    for (const std::size_t k : island) {
      confirmed += map.nodes[k].support > kConfirmed ? 1 : 0;
      seeds += map.nodes[k].seeded ? 1 : 0;
    }
    const bool slipped = seeds == 0 && confirmed == 0;
    const bool large = island.size() >= static_cast<std::size_t>(min_nodes);
    if (slipped || (!large && 2 * confirmed < island.size()))
      dropped += drop_nodes(island, HoleReason::kContradicted, map);
  });
  return dropped;
}

}  // namespace pencilscan
