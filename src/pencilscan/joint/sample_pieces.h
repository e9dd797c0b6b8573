#pragma once

// Curves at random, for tests of the terms of the energy against plain loops.

#include <algorithm>
#include <cmath>

#include "pencilscan/core/random.h"
#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/surroundings.h"

namespace pencilscan::sample {

inline const CurvePoint& point_of(const GridGraph& graph, const CurvePiece& piece, int i) {
  return graph.curves[static_cast<std::size_t>(piece.curve)].points[static_cast<std::size_t>(i)];
}

inline const Curve& curve_of(const GridGraph& graph, const CurvePiece& piece) {
  return graph.curves[static_cast<std::size_t>(piece.curve)];
}

/// Bent curves anywhere in the image of a small camera, most of them side by side, a point per
/// pixel.
inline GridGraph random_curves(const Camera& camera, int count, Random& random) {
  GridGraph graph;
  for (int k = 0; k < count; ++k) {
    Curve curve;
    curve.family = static_cast<int>(random.below(2));
    Eigen::Vector2d at(random.uniform(0, camera.width), random.uniform(0, camera.height));
    double angle = random.below(5) == 0 ? random.uniform(0, 6.28) : random.uniform(-0.4, 0.4);
    const double bend = random.uniform(-0.01, 0.01);
    const std::uint32_t length = 8 + random.below(60);
    for (std::uint32_t i = 0; i < length && camera.contains(at); ++i) {
      CurvePoint point;
      point.position = at.cast<float>();
      point.normal = Eigen::Vector2d(std::sin(angle), -std::cos(angle)).cast<float>();
      point.sigma_px = 0.05F;
      curve.points.push_back(point);
      at += random.uniform(0.8, 1.2) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      angle += bend;
    }
    if (curve.points.size() >= 4) graph.curves.push_back(curve);
  }
  return graph;
}

inline void add_random_crossings(std::size_t count, PieceGraph& graph, Random& random) {
  const auto pieces = static_cast<std::uint32_t>(graph.pieces.size());
  for (std::size_t i = 0; i < count; ++i) {
    PieceCrossing crossing;
    crossing.a = static_cast<int>(random.below(pieces));
    crossing.b = static_cast<int>(random.below(pieces));
    graph.crossings.push_back(crossing);
  }
}

/// Beliefs that sum to at most one; some labels have next to none.
inline PieceBeliefs random_beliefs(const LabelledPieces& pieces, Random& random) {
  PieceBeliefs beliefs;
  for (const auto& labels : pieces.labels) {
    std::vector<float> of_piece;
    double left = 1;
    for (std::size_t k = 0; k < labels.size(); ++k) {
      const double belief = left * (random.below(3) == 0 ? 0.001 : random.uniform());
      of_piece.push_back(static_cast<float>(belief));
      left -= belief;
    }
    beliefs.push_back(of_piece);
  }
  return beliefs;
}

}  // namespace pencilscan::sample
