#include "pencilscan/joint/surroundings.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <utility>

#include "pencilscan/view/places.h"

namespace pencilscan {
namespace {

constexpr int kSurroundingsPx = 16;
constexpr std::size_t kMaxNeighbors = 6;

struct PiecePlace {
  int piece = 0;
  int curve = 0;
  Eigen::Vector2f pixel;
};

}  // namespace

Surroundings::Surroundings(const Camera& camera, const GridGraph& graph,
                           const LabelledPieces& pieces)
    : pieces_(pieces) {
  Places<PiecePlace> places(camera.width, camera.height, kSurroundingsPx);
  const auto point = [&](const CurvePiece& piece, int i) -> const Eigen::Vector2f& {
    return graph.curves[static_cast<std::size_t>(piece.curve)]
        .points[static_cast<std::size_t>(i)]
        .position;
  };
  const auto& list = pieces.graph.pieces;
  for (std::size_t p = 0; p < list.size(); ++p) {
    for (int i = list[p].begin; i < list[p].end; i += 2) {
      const Eigen::Vector2f& x = point(list[p], i);
      places.add(x, {static_cast<int>(p), list[p].curve, x});
    }
  }
  std::vector<std::pair<int, int>> crossing;
  for (const PieceCrossing& x : pieces.graph.crossings) {
    crossing.emplace_back(x.a, x.b);
    crossing.emplace_back(x.b, x.a);
  }
  std::sort(crossing.begin(), crossing.end());
  // Squared distance and best place of each piece around.
  std::vector<std::tuple<float, int, Eigen::Vector2f>> nearest;
  for (std::size_t p = 0; p < list.size(); ++p) {
    const Eigen::Vector2f middle = point(list[p], (list[p].begin + list[p].end) / 2);
    nearest.clear();
    auto known = nearest.end();
    places.around(middle, kSurroundingsPx, [&](const PiecePlace& place) {
      const float d = (place.pixel - middle).squaredNorm();
      if (d > kSurroundingsPx * kSurroundingsPx || place.curve == list[p].curve) return;
      // Places of one piece follow each other.
      if (known == nearest.end() || std::get<1>(*known) != place.piece) {
        known = std::find_if(nearest.begin(), nearest.end(),
                             [&](const auto& n) { return std::get<1>(n) == place.piece; });
      }
      if (known == nearest.end()) {
        nearest.emplace_back(d, place.piece, place.pixel);
        known = nearest.end() - 1;
      } else if (d < std::get<0>(*known)) {
        *known = {d, place.piece, place.pixel};
      }
    });
    std::erase_if(nearest, [&](const auto& n) {
      return std::binary_search(crossing.begin(), crossing.end(),
                                std::pair(static_cast<int>(p), std::get<1>(n)));
    });
    std::sort(nearest.begin(), nearest.end(), [](const auto& a, const auto& b) {
      return std::pair(std::get<0>(a), std::get<1>(a)) < std::pair(std::get<0>(b), std::get<1>(b));
    });
    if (nearest.size() > kMaxNeighbors) nearest.resize(kMaxNeighbors);
    for (const auto& [d, other, pixel] : nearest) {
      neighbors_.push_back({static_cast<int>(p), other,
                            camera.normalized_from_pixel(pixel.cast<double>()).cast<float>()});
    }
  }
}

std::vector<std::vector<float>> Surroundings::costs(const PieceBeliefs& beliefs) const {
  constexpr float kSlope = 1;   // usual depth change per sideways change
  constexpr float kFewest = 2;  // one neighbour alone counts half
  constexpr float kWeight = 2;  // of all neighbours together: they mostly say the same
  std::vector<std::vector<float>> result;
  for (const auto& labels : pieces_.labels) result.emplace_back(labels.size(), 0.F);
  if (beliefs.empty()) return result;
  std::vector<float> count(result.size(), 0.F);
  for (const Neighbor& n : neighbors_) count[static_cast<std::size_t>(n.piece)] += 1;
  std::vector<std::pair<float, float>> theirs;  // belief and inverse depth of likely labels
  for (const Neighbor& n : neighbors_) {
    const auto p = static_cast<std::size_t>(n.piece);
    const auto o = static_cast<std::size_t>(n.other);
    const Eigen::Vector2f& middle = pieces_.graph.pieces[p].middle;
    const float distance = std::max(1e-6F, (middle - n.place).norm());
    theirs.clear();
    float known = 0;
    for (std::size_t j = 0; j < pieces_.labels[o].size(); ++j) {
      if (beliefs[o][j] < 0.01F) continue;
      theirs.emplace_back(beliefs[o][j], pieces_.labels[o][j].q.dot(n.place.homogeneous()));
      known += beliefs[o][j];
    }
    const float weight = kWeight / std::max(kFewest, count[p]);
    for (std::size_t k = 0; k < result[p].size(); ++k) {
      const float w = pieces_.labels[p][k].q.dot(middle.homogeneous());
      const float per_slope = 1 / (w * distance);
      // Slope of the volume's whole depth, at this distance: what labels at random give.
      const float range = pieces_.inverse_depth_range * per_slope;
      float likelihood = 0;
      for (const auto& [belief, their_w] : theirs) {
        const float slope = (their_w - w) * per_slope;
        likelihood += belief / (kSlope * kSlope + slope * slope);
      }
      likelihood *= range * kSlope / std::numbers::pi_v<float>;
      result[p][k] -= weight * std::log(std::max(0.05F, likelihood + 1 - known));
    }
  }
  return result;
}

}  // namespace pencilscan
