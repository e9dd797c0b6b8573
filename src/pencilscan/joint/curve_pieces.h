#pragma once

#include <vector>

#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A stretch of a detected curve that is labelled as one.
struct CurvePiece {
  int curve = 0;
  int begin = 0;                                      ///< first point
  int end = 0;                                        ///< one past the last
  Eigen::Vector2f middle = Eigen::Vector2f::Zero();   ///< normalised camera coordinates
  Eigen::Vector2f tangent = Eigen::Vector2f::Zero();  ///< unit, there
  float sigma = 0;  ///< standard deviation across, normalised units
};

/// Which way a curve runs at a place of it.
struct CurveDirection {
  Eigen::Vector2f tangent = Eigen::Vector2f::Zero();  ///< unit, normalised camera coordinates
  float sigma = 0;                                    ///< standard deviation, rad
};

/// Two pieces that cross.
struct PieceCrossing {
  int a = 0;
  int b = 0;
  Eigen::Vector2f position = Eigen::Vector2f::Zero();  ///< normalised camera coordinates
  float sigma = 0;                                     ///< normalised units
  CurveDirection along_a;
  CurveDirection along_b;
};

struct PieceGraph {
  std::vector<CurvePiece> pieces;
  std::vector<PieceCrossing> crossings;
  std::vector<std::pair<int, int>> continuations;  ///< consecutive pieces of one curve
  double spacing_px = 0;                           ///< of the lines in this camera, > 0
};

/// Cuts the curves of one camera into pieces of at most `length` points. `spacing_px`: of the lines
/// there.
[[nodiscard]] PieceGraph cut_into_pieces(const Camera& camera, const GridGraph& graph, int length,
                                         double spacing_px);

/// Per piece, 1 where it crosses another.
[[nodiscard]] std::vector<char> crossed_pieces(const PieceGraph& graph);
/// Per piece, 1 where some piece of its curve crosses another.
[[nodiscard]] std::vector<char> pieces_of_crossed_curves(const PieceGraph& graph);

}  // namespace pencilscan
