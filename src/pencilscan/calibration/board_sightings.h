#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "pencilscan/bundle/bundle.h"

namespace pencilscan {

/// One camera's view of one placing: places in problem.board_views.
struct BoardSighting {
  std::size_t board = 0;
  std::size_t device = 0;
  std::vector<std::size_t> views;
};

[[nodiscard]] std::vector<BoardSighting> sightings_of(const std::vector<BoardView>& views);

/// Nothing where the corners tell no pose.
[[nodiscard]] std::optional<RigidTransform> camera_from_board(const BundleProblem& problem,
                                                              const BoardSighting& s);

/// Cameras may number the corners of one board from either end: the end that fits its pose counts.
void agree_on_end(const BoardSighting& s, BundleProblem& problem);

/// Boards and cameras follow from each other, from the devices that are present; without any, from
/// the first board that was seen, which is the world. Returns, per board, whether it has a pose.
[[nodiscard]] std::vector<char> grow_from_boards(BundleProblem& problem);

}  // namespace pencilscan
