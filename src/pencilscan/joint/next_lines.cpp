#include "pencilscan/joint/next_lines.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "pencilscan/rig/object_space.h"
#include "pencilscan/view/places.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

struct LinePlace {
  Vector2f pixel;
  Vector2f tangent;
  int curve;
  int piece;
};

constexpr int kNextLineCellPx = 16;
/// Most next lines are nearer: a look so far, and then to the whole reach, finds the same sooner.
constexpr float kNearPx = 12;

// Negative log-likelihoods (docs/solutions.md, "order"): one line further counts as 4.5 times as
// likely as what says nothing, the wrong order as a twentieth. They are chosen, no fit of them is
// kept; experiments/one_projector.py shows what they do.
constexpr float kNext = -1.5F;
constexpr float kWrongOrder = 3;

}  // namespace

bool lacks_crossings(const PieceGraph& graph) {
  constexpr double kShare = 0.1;
  const double length =
      std::accumulate(graph.pieces.begin(), graph.pieces.end(), 0.0,
                      [](double sum, const CurvePiece& p) { return sum + p.end - p.begin; });
  return static_cast<double>(graph.crossings.size()) < kShare * length / (2 * graph.spacing_px);
}

float next_line_reach_px(const Rig& rig, const Camera& camera) {
  constexpr double kUsual = 48;  // px
  constexpr double kSpacings = 4;
  const double spacing = pixels_at_center(rig, camera, line_spacing(rig));
  return static_cast<float>(std::max(kUsual, kSpacings * spacing));
}

std::vector<NextPiece> next_pieces(const Camera& camera, const GridGraph& graph,
                                   const PieceGraph& pieces, float reach_px,
                                   std::span<const char> left_out) {
  const auto is_left_out = [&](std::size_t p) { return !left_out.empty() && left_out[p] != 0; };
  Places<LinePlace> places(camera.width, camera.height, kNextLineCellPx);
  for (std::size_t p = 0; p < pieces.pieces.size(); ++p) {
    if (is_left_out(p)) continue;
    const CurvePiece& piece = pieces.pieces[p];
    for (int i = piece.begin; i < piece.end; ++i) {
      const CurvePoint& point =
          graph.curves[static_cast<std::size_t>(piece.curve)].points[static_cast<std::size_t>(i)];
      places.add(point.position,
                 {point.position, point.tangent(), piece.curve, static_cast<int>(p)});
    }
  }
  std::vector<NextPiece> result;
  std::set<std::pair<int, int>> seen;
  const std::vector<char> is_crossed = crossed_pieces(pieces);
  for (std::size_t p = 0; p < pieces.pieces.size(); ++p) {
    if (is_crossed[p] != 0 || is_left_out(p)) continue;
    const CurvePiece& piece = pieces.pieces[p];
    const Curve& curve = graph.curves[static_cast<std::size_t>(piece.curve)];
    const CurvePoint& middle =
        curve.points[static_cast<std::size_t>((piece.begin + piece.end) / 2)];
    const Vector2f tangent = middle.tangent();
    const Vector2f normal(tangent.y(), -tangent.x());
    const Vector2f& at = middle.position;
    const auto nearest_within = [&](float reach, float side) {
      constexpr float kAlong = 1;          // px: points of a curve lie so far apart
      constexpr float kSameLinePx = 1.5F;  // what is nearer is taken for the same line
      constexpr float kAlike = 0.85F;      // cosine of 32 degrees
      float nearest = reach;
      const LinePlace* found = nullptr;
      places.around(at, std::hypot(reach, kAlong), [&](const LinePlace& place) {
        const Vector2f way = place.pixel - at;
        const float across = side * way.dot(normal);
        if (across < kSameLinePx || across >= nearest || std::abs(way.dot(tangent)) > kAlong)
          return;
        if (place.curve == piece.curve || std::abs(place.tangent.dot(tangent)) < kAlike ||
            graph.curves[static_cast<std::size_t>(place.curve)].family != curve.family)
          return;
        nearest = across;
        found = &place;
      });
      return found;
    };
    for (const float side : {1.F, -1.F}) {
      const LinePlace* found = nearest_within(kNearPx, side);
      if (found == nullptr) found = nearest_within(reach_px, side);
      if (found == nullptr) continue;
      const int a = static_cast<int>(p);
      if (!seen.insert(std::minmax(a, found->piece)).second) continue;
      result.push_back({a, found->piece, at, tangent, side});
    }
  }
  return result;
}

float next_piece_cost(const PieceLabel& a, const PieceLabel& b, int order) {
  // Of lines between the two that were not detected. Chosen like kNext.
  constexpr float kOneMissed = 0.5F;
  constexpr float kMoreMissed = 2;
  if (order == 0) return 0;
  if (!(a.pattern == b.pattern)) return kMoreMissed;
  switch ((b.line - a.line) * order) {
    case 1:
      return kNext;
    case 2:
      return kOneMissed;
    default:
      return (b.line - a.line) * order > 0 ? kMoreMissed : kWrongOrder;
  }
}

float next_uncrossed_cost(const PieceLabel& a, const PieceLabel& b, int order) {
  if (order == 0 || !(a.pattern == b.pattern)) return 0;
  const int lines = (b.line - a.line) * order;
  return lines == 1 ? kNext : lines > 0 ? 0 : kWrongOrder;
}

}  // namespace pencilscan
