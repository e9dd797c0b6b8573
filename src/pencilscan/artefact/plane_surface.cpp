#include "pencilscan/artefact/plane_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr double kCellShare = 0.1;  ///< of the median distance
/// Points per cell where they are few: of so many, scattered evenly at random, a cell holds none
/// once in 3000.
constexpr double kPerCell = 8;

/// Of a cell and its eight neighbours, those that hold points where a surface goes on. A strip that
/// is narrower than a cell, as where another surface crosses the plane, holds six at most.
constexpr int kGoesOn = 7;

using Cell = std::array<int, 2>;  ///< column, row

/// Side of the cells: half of the points lie within the median distance of their middle.
double cell_side(const std::vector<Vec2>& points) {
  std::vector<double> x, y, distance;
  for (const Vec2& point : points) {
    x.push_back(point.x());
    y.push_back(point.y());
  }
  const Vec2 middle(upper_median(std::move(x)), upper_median(std::move(y)));
  for (const Vec2& point : points) distance.push_back((point - middle).norm());
  const double median = upper_median(std::move(distance));
  const double inner = 0.5 * static_cast<double>(points.size());
  return median * std::max(kCellShare, std::sqrt(kPerCell * std::numbers::pi / inner));
}

/// Cells that hold points, with these.
using Cells = std::map<Cell, std::vector<std::size_t>>;

template <typename Each>
void for_each_around(const Cell& cell, const Each& each) {
  for (int dx = -1; dx <= 1; ++dx)
    for (int dy = -1; dy <= 1; ++dy) each(Cell{cell[0] + dx, cell[1] + dy});
}

/// Cells from which a surface goes on; of so few cells that there is none, all.
std::set<Cell> inner_cells(const Cells& cells) {
  std::set<Cell> inner, all;
  for (const auto& [cell, points] : cells) {
    int full = 0;
    for_each_around(cell, [&](const Cell& other) { full += cells.contains(other) ? 1 : 0; });
    if (full >= kGoesOn) inner.insert(cell);
    all.insert(cell);
  }
  return inner.empty() ? all : inner;
}

/// Takes what is connected to the first of the inner cells: those out of `inner`, and the points of
/// all out of `cells`.
std::vector<std::vector<std::size_t>> take_connected(std::set<Cell>& inner, Cells& cells) {
  std::vector<std::vector<std::size_t>> taken;
  std::vector<Cell> open{*inner.begin()};
  while (!open.empty()) {
    const Cell at = open.back();
    open.pop_back();
    if (const auto found = cells.find(at); found != cells.end()) {
      taken.push_back(std::move(found->second));
      cells.erase(found);
    }
    if (inner.erase(at) == 0) continue;
    for_each_around(at, [&](const Cell& other) { open.push_back(other); });
  }
  return taken;
}

}  // namespace

PlaneSurface connected_surface(std::span<const Vec3> points, const PlateRectangle& rectangle) {
  const Vec3 across = rectangle.plane.normal.cross(rectangle.along);
  std::vector<Vec2> flat;
  for (const Vec3& point : points) {
    const Vec3 offset = point - rectangle.center;
    flat.emplace_back(rectangle.along.dot(offset), across.dot(offset));
  }
  const double side = cell_side(flat);
  if (!(side > 0)) return {};
  // Points farther off than this are none of a surface around the middle, and too far to count.
  constexpr double kFarthest = 1e6;  // cells
  Cells cells;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    const Vec2 at = flat[i] / side;
    if (!(at.cwiseAbs().maxCoeff() < kFarthest)) continue;
    cells[{static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y()))}].push_back(
        i);
  }
  const auto is_inside = [&](std::size_t i) {
    return std::abs(flat[i].x()) <= rectangle.length / 2 &&
           std::abs(flat[i].y()) <= rectangle.width / 2;
  };
  std::vector<Vec3> best;
  std::size_t best_cells = 0;
  std::array<std::size_t, 2> most{0, 0};  // inside of the rectangle; in all
  for (std::set<Cell> inner = inner_cells(cells); !inner.empty();) {
    const auto taken = take_connected(inner, cells);
    std::vector<Vec3> piece;
    std::size_t inside = 0;
    for (const auto& cell : taken) {
      for (const std::size_t i : cell) {
        piece.push_back(points[i]);
        inside += is_inside(i) ? 1 : 0;
      }
    }
    const std::array<std::size_t, 2> many{inside, piece.size()};
    if (many <= most) continue;
    most = many;
    best = std::move(piece);
    best_cells = taken.size();
  }
  if (best.size() < 3) return {};
  const PlateRectangle whole = smallest_rectangle(best, rectangle.plane);
  // Cells at the rim reach beyond it; corners that hold nothing are no surface.
  const double of_cells = static_cast<double>(best_cells) * side * side;
  return {std::min(of_cells, whole.length * whole.width), whole.length, whole.width};
}

}  // namespace pencilscan
