#include "pencilscan/guided/line_chains.h"

#include <algorithm>
#include <map>
#include <tuple>

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Points of one line that no chain holds yet.
class LoosePoints {
 public:
  explicit LoosePoints(const std::vector<const PredictedPoint*>& points)
      : points_(points), used_(points.size(), 0) {}

  [[nodiscard]] bool is_used(std::size_t i) const { return used_[i] != 0; }
  const PredictedPoint* take(std::size_t i) {
    used_[i] = 1;
    return points_[i];
  }
  /// Takes the nearest point ahead; nullptr: none.
  const PredictedPoint* take_next(const Vector2f& at, const Vector2f& ahead) {
    constexpr float kLink2 = 2.5F * 2.5F;
    float best = kLink2;
    std::size_t found = points_.size();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Vector2f way = points_[i]->position - at;
      if (is_used(i) || way.squaredNorm() >= best || way.dot(ahead) <= 0) continue;
      best = way.squaredNorm();
      found = i;
    }
    return found < points_.size() ? take(found) : nullptr;
  }

 private:
  const std::vector<const PredictedPoint*>& points_;
  std::vector<char> used_;
};

}  // namespace

std::vector<LineChain> chain_points(std::span<const PredictedPoint> points) {
  std::map<std::tuple<int, int, int>, std::vector<const PredictedPoint*>> lines;
  for (const PredictedPoint& p : points)
    lines[{p.pattern.projector, p.pattern.pattern, p.line}].push_back(&p);
  std::vector<LineChain> chains;
  for (const auto& [name, of_line] : lines) {
    LoosePoints loose(of_line);
    for (std::size_t i = 0; i < of_line.size(); ++i) {
      if (loose.is_used(i)) continue;
      LineChain chain = {*loose.take(i)};
      for (const float direction : {1.F, -1.F}) {
        const PredictedPoint* end = of_line[i];
        while (end != nullptr) {
          const Vector2f ahead = direction * Vector2f(-end->normal.y(), end->normal.x());
          end = loose.take_next(end->position, ahead);
          if (end != nullptr) chain.push_back(*end);
        }
        std::reverse(chain.begin(), chain.end());
      }
      chains.push_back(std::move(chain));
    }
  }
  return chains;
}

}  // namespace pencilscan
