#include "pencilscan/bundle/board_corners.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

/// Robust deviation of one coordinate of the corners, px.
double corner_scatter(const BundleProblem& problem) {
  std::vector<double> errors;
  for (const BoardView& v : problem.board_views) {
    if (!problem.devices[v.view.device].present) continue;
    const Vec2 error = corner_error(problem, v);
    errors.push_back(std::abs(error.x()));
    errors.push_back(std::abs(error.y()));
  }
  return errors.empty() ? 0 : kDeviationPerMedian * upper_median(std::move(errors));
}

}  // namespace

Vec3 corner_point(const BundleProblem& problem, const BoardView& view) {
  return transform_from(problem.board_poses[view.board]) *
         Vec3(view.position_mm.x(), view.position_mm.y(), 0);
}

Vec2 corner_error(const BundleProblem& problem, const BoardView& view) {
  constexpr double kBehind = 1e3;  // px: off by more than any corner that is kept
  return view_error(problem.devices[view.view.device], corner_point(problem, view), view.view)
      .value_or(Vec2(kBehind, 0));
}

void weigh_corners(BundleProblem& problem) {
  constexpr double kLeastSigmaPx = 0.1;  // as corners are expected to scatter (boards/board.cpp)
  // Boards are never quite flat, and corners share that: they count three times their own scatter
  // (docs/calibration.md, "Boards"). Chosen; no fit of it is kept.
  constexpr double kShared = 3;
  const double sigma = kShared * std::max(kLeastSigmaPx, corner_scatter(problem));
  for (BoardView& v : problem.board_views) v.view.sigma_px = sigma;
}

void drop_corners(BundleProblem& problem, double deviations) {
  constexpr double kLeastLimitPx = 0.5;  // such corners stay, however well the rest fits
  const double limit = std::max(kLeastLimitPx, deviations * corner_scatter(problem));
  std::erase_if(problem.board_views,
                [&](const BoardView& v) { return corner_error(problem, v).norm() > limit; });
}

double board_rms_px(const BundleProblem& problem) {
  double sum = 0;
  std::size_t corners = 0;
  for (const BoardView& v : problem.board_views) {
    if (!problem.devices[v.view.device].present) continue;
    sum += corner_error(problem, v).squaredNorm();
    ++corners;
  }
  return corners > 0 ? std::sqrt(sum / static_cast<double>(corners)) : 0;
}

bool boards_join_devices(const std::vector<BoardView>& views) {
  std::map<std::size_t, std::size_t> seen_by;
  return std::any_of(views.begin(), views.end(), [&](const BoardView& v) {
    return seen_by.try_emplace(v.board, v.view.device).first->second != v.view.device;
  });
}

}  // namespace pencilscan
