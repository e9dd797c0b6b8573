#include "pencilscan/joint/darkness.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

/// By how much the best label of a piece must lead to stand for a true one: what two crossings say
/// at least, 2 x -log(0.05) (JointOptions::crossing_outliers).
constexpr float kClearLead = 6;

constexpr char kOut = 0;  ///< not in that picture
constexpr char kLit = 1;
constexpr char kDark = 2;

/// Labels that have their place in a camera's picture.
struct Sightings {
  double all = 0;
  double dark = 0;

  void add(char seen) {
    all += seen != kOut ? 1 : 0;
    dark += seen == kDark ? 1 : 0;
  }
  /// Laplace's rule: what was never seen may be.
  [[nodiscard]] double dark_share() const { return (dark + 1) / (all + 2); }
};

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
    : rig_(rig),
      graphs_(graphs),
      pieces_(pieces),
      weights_(graphs.size(), 0.F),
      seen_(graphs.size()) {
  parallel_for(graphs.size(), [&](std::size_t g) { seen_[g] = look_from_others(g); });
  weigh_views();
}

std::vector<char> Darkness::look_from_others(std::size_t g) const {
  const LabelledPieces& own = pieces_[g];
  const RigidTransform world_from_camera =
      rig_.camera(graphs_[g].camera).device_from_world.inverse();
  std::vector<char> seen;
  for (std::size_t p = 0; p < own.labels.size(); ++p) {
    for (const PieceLabel& label : own.labels[p]) {
      const Vec3 place = world_from_camera * label.place(own.graph.pieces[p].middle);
      for (std::size_t o = 0; o < graphs_.size(); ++o) {
        char& is = seen.emplace_back(kOut);
        if (o == g || graphs_[o].lit.is_lit.empty()) continue;
        const Camera& other = rig_.camera(graphs_[o].camera);
        const auto pixel = other.project(place);
        if (!pixel || !other.contains(*pixel)) continue;
        is = graphs_[o].lit.is_dark(*pixel) ? kDark : kLit;
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
    const char* seen = seen_[g].data();
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
    weights_[o] =
        static_cast<float>(std::max(0.0, std::log(all[o].dark_share() / best[o].dark_share())));
}

std::vector<std::vector<float>> Darkness::costs(std::size_t g) const {
  std::vector<std::vector<float>> result;
  const char* seen = seen_[g].data();
  for (const auto& labels : pieces_[g].labels) {
    for (float& cost : result.emplace_back(labels.size(), 0.F)) {
      for (std::size_t o = 0; o < graphs_.size(); ++o)
        if (seen[o] == kDark) cost = std::max(cost, weights_[o]);
      seen += graphs_.size();
    }
  }
  return result;
}

}  // namespace pencilscan
