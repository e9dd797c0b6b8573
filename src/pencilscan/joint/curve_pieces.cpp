#include "pencilscan/joint/curve_pieces.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace pencilscan {
namespace {

Eigen::Vector2f normalized(const Camera& camera, const Eigen::Vector2f& pixel) {
  return camera.normalized_from_pixel(pixel.cast<double>()).cast<float>();
}

/// Direction of a curve by a chord around a place of it.
CurveDirection direction(const Camera& camera, std::span<const CurvePoint> points, float at,
                         float pixel_size) {
  constexpr int kHalfChord = 6;  // points
  const int last = static_cast<int>(points.size()) - 1;
  const int middle = std::clamp(static_cast<int>(std::lround(at)), 0, last);
  const auto& low = points[static_cast<std::size_t>(std::max(0, middle - kHalfChord))];
  const auto& high = points[static_cast<std::size_t>(std::min(last, middle + kHalfChord))];
  const Eigen::Vector2f chord =
      normalized(camera, high.position) - normalized(camera, low.position);
  return {chord.normalized(), std::hypot(low.sigma_px, high.sigma_px) * pixel_size /
                                  std::max(chord.norm(), pixel_size)};
}

}  // namespace

PieceGraph cut_into_pieces(const Camera& camera, const GridGraph& graph, int length,
                           double spacing_px) {
  PieceGraph result;
  result.spacing_px = spacing_px;
  const auto pixel_size = static_cast<float>(1 / camera.focal_px());
  std::vector<int> first_piece;
  for (std::size_t c = 0; c < graph.curves.size(); ++c) {
    const auto& points = graph.curves[c].points;
    const int n = static_cast<int>(points.size());
    const int count = std::max(1, (n + length - 1) / length);
    first_piece.push_back(static_cast<int>(result.pieces.size()));
    for (int k = 0; k < count; ++k) {
      CurvePiece piece;
      piece.curve = static_cast<int>(c);
      piece.begin = k * n / count;
      piece.end = (k + 1) * n / count;
      const int middle = (piece.begin + piece.end) / 2;
      const CurvePoint& point = points[static_cast<std::size_t>(middle)];
      const auto own = std::span(points).subspan(static_cast<std::size_t>(piece.begin),
                                                 static_cast<std::size_t>(piece.end - piece.begin));
      piece.middle = normalized(camera, point.position);
      piece.tangent =
          direction(camera, own, static_cast<float>(middle - piece.begin), pixel_size).tangent;
      piece.sigma = point.sigma_px * pixel_size;
      if (k > 0) {
        const int here = static_cast<int>(result.pieces.size());
        result.continuations.emplace_back(here - 1, here);
      }
      result.pieces.push_back(piece);
    }
  }
  first_piece.push_back(static_cast<int>(result.pieces.size()));
  const auto piece_at = [&](int curve, float at) {
    const int first = first_piece[static_cast<std::size_t>(curve)];
    const int count = first_piece[static_cast<std::size_t>(curve) + 1] - first;
    int k = 0;
    while (k + 1 < count &&
           static_cast<float>(result.pieces[static_cast<std::size_t>(first + k)].end) <= at)
      ++k;
    return first + k;
  };
  for (const Crossing& x : graph.crossings) {
    const auto along = [&](int curve, float at) {
      return direction(camera, graph.curves[static_cast<std::size_t>(curve)].points, at,
                       pixel_size);
    };
    result.crossings.push_back({piece_at(x.curve_a, x.at_a), piece_at(x.curve_b, x.at_b),
                                normalized(camera, x.position), x.sigma_px * pixel_size,
                                along(x.curve_a, x.at_a), along(x.curve_b, x.at_b)});
  }
  return result;
}

std::vector<char> crossed_pieces(const PieceGraph& graph) {
  std::vector<char> crossed(graph.pieces.size(), 0);
  for (const PieceCrossing& x : graph.crossings)
    crossed[static_cast<std::size_t>(x.a)] = crossed[static_cast<std::size_t>(x.b)] = 1;
  return crossed;
}

std::vector<char> pieces_of_crossed_curves(const PieceGraph& graph) {
  std::vector<char> crossed = crossed_pieces(graph);
  const auto& chain = graph.continuations;  // ordered along each curve
  const auto join = [&](int from, int to) {
    crossed[static_cast<std::size_t>(to)] |= crossed[static_cast<std::size_t>(from)];
  };
  for (std::size_t i = 0; i < chain.size(); ++i) join(chain[i].first, chain[i].second);
  for (std::size_t i = chain.size(); i-- > 0;) join(chain[i].second, chain[i].first);
  return crossed;
}

}  // namespace pencilscan
