#pragma once

#include <Eigen/Core>
#include <vector>

#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

struct SingleProjectorOptions {
  double step_lines = 0.1;  ///< sweep step of the most moving curve; > 0
};

/// The one-projector grid method that the paper compares itself with (section V-C): R. Sagawa,
/// Y. Ota, Y. Yagi, R. Furukawa, N. Asada, H. Kawasaki, "Dense 3D reconstruction method using a
/// single pattern for fast moving object", ICCV 2009.
///
/// A projector shows a grid: vertical and horizontal lines, that is two pencils of planes through
/// its centre. Every crossing gives the same equation as between two projectors, A mu - B rho = -C
/// (equation (6) of the paper). But the plane through the centre that holds both axes belongs to
/// both pencils and solves every equation as well, so that with planes p_k all of
///   q + t (p_k - q)
/// do: the equations leave one degree of freedom, whatever the grid's size. So x(s) = x0 + s e with
/// M e = 0, and s is searched: where it is right, every curve lies on a line of the pattern with
/// its local de Bruijn ID. The cost of s is the mean over the curves of the squared distance to the
/// nearest such line, in lines, at most half a period.
///
/// No other camera is asked. Positions a period of IDs apart differ only in that not all curves
/// shift by the same number of lines, so that the search needs curves whose IDs are right and which
/// hang together in one grid: a finger between two lines has none.
/// Deviations: distances count in lines, where the original takes angles of planes; crossings that
/// contradict the IDs have been cut by the grid stage already.
struct GridSolution {
  int projector = 0;
  std::vector<int> curves;    ///< curve index of each unknown
  Eigen::VectorXd mu;         ///< x0, the solution nearest to the middle of the volume
  Eigen::VectorXd direction;  ///< e, largest entry 1
  std::vector<int> lines;     ///< per unknown; -1: outside the volume or the panel
  ComponentReport report;
};

/// Solves every connected grid of one camera: curves of one projector that cross.
[[nodiscard]] std::vector<GridSolution> solve_grids(const Rig& rig, const GridGraph& graph,
                                                    const SingleProjectorOptions& options = {});

/// True where some projector shows lines of both orientations.
[[nodiscard]] bool shows_grid(const Rig& rig);

}  // namespace pencilscan
