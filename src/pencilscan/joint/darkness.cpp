#include "pencilscan/joint/darkness.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

/// By how much the best label of a piece must lead to stand for a true one: what two crossings say
/// at least, 2 x -log(0.05) (JointOptions::crossing_outliers).
constexpr float kClearLead = 6;

/// Labels that have their place in a camera's picture, and what it sees there.
struct Sightings {
  double all = 0;
  std::array<double, kSights> of{};

  void add(std::uint8_t seen) {
    if (seen >= kSights) return;
    ++all;
    ++of[seen];
  }
  /// Laplace's rule: what was never seen may be.
  [[nodiscard]] double share(std::size_t sight) const { return (of[sight] + 1) / (all + 2); }
};

constexpr std::uint8_t kOut = 255;  ///< not in that picture

/// The label that leads all others clearly; -1: none does.
std::ptrdiff_t clear_winner(std::span<const float> scores) {
  const auto best = std::min_element(scores.begin(), scores.end());
  for (auto other = scores.begin(); other != scores.end(); ++other)
    if (other != best && *other < *best + kClearLead) return -1;
  return scores.empty() ? -1 : best - scores.begin();
}

}  // namespace

Darkness::Darkness(const Rig& rig, std::span<const GridGraph> graphs,
                   std::span<const LabelledPieces> pieces)
    : rig_(rig), graphs_(graphs), pieces_(pieces), weights_(graphs.size()), seen_(graphs.size()) {
  parallel_for(graphs.size(), [&](std::size_t g) { seen_[g] = look_from_others(g); });
  weigh_views();
}

std::vector<std::uint8_t> Darkness::look_from_others(std::size_t g) const {
  const LabelledPieces& own = pieces_[g];
  const RigidTransform world_from_camera =
      rig_.camera(graphs_[g].camera).device_from_world.inverse();
  std::vector<std::uint8_t> seen;
  for (std::size_t p = 0; p < own.labels.size(); ++p) {
    for (const PieceLabel& label : own.labels[p]) {
      const Vec3 place = world_from_camera * label.place(own.graph.pieces[p].middle);
      for (std::size_t o = 0; o < graphs_.size(); ++o) {
        std::uint8_t& is = seen.emplace_back(kOut);
        if (o == g || graphs_[o].lit.seen.empty()) continue;
        const Camera& other = rig_.camera(graphs_[o].camera);
        const auto pixel = other.project(place);
        if (!pixel || !other.contains(*pixel)) continue;
        is = static_cast<std::uint8_t>(graphs_[o].lit.at(*pixel));
      }
    }
  }
  return seen;
}

void Darkness::weigh_views() {
  std::vector<Sightings> best(graphs_.size());
  std::vector<Sightings> all(graphs_.size());
  for (std::size_t g = 0; g < pieces_.size(); ++g) {
    const std::vector<char> is_crossed = crossed_pieces(pieces_[g].graph);
    const std::uint8_t* seen = seen_[g].data();
    for (std::size_t p = 0; p < is_crossed.size(); ++p) {
      const std::vector<float>& scores = pieces_[g].scores[p];
      const std::ptrdiff_t winner = clear_winner(scores);
      for (std::ptrdiff_t k = 0; k < std::ssize(scores); ++k, seen += graphs_.size()) {
        if (is_crossed[p] == 0) continue;
        for (std::size_t o = 0; o < graphs_.size(); ++o) {
          all[o].add(seen[o]);
          if (k == winner) best[o].add(seen[o]);
        }
      }
    }
  }
  for (std::size_t o = 0; o < graphs_.size(); ++o)
    for (std::size_t sight = 0; sight < kSights; ++sight)
      weights_[o][sight] =
          static_cast<float>(std::max(0.0, std::log(all[o].share(sight) / best[o].share(sight))));
}

std::vector<std::vector<float>> Darkness::costs(std::size_t g) const {
  std::vector<std::vector<float>> result;
  const std::uint8_t* seen = seen_[g].data();
  for (const auto& labels : pieces_[g].labels) {
    for (float& cost : result.emplace_back(labels.size(), 0.F)) {
      for (std::size_t o = 0; o < graphs_.size(); ++o)
        if (seen[o] < kSights) cost = std::max(cost, weights_[o][seen[o]]);
      seen += graphs_.size();
    }
  }
  return result;
}

}  // namespace pencilscan
