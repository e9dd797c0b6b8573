#pragma once

namespace pencilscan {

/// Products of the columns of a tall matrix J with each other, J' J, which Eigen's general product
/// computes twice and packs first. J: column by column, `rows` x `columns`, rows a multiple of
/// kLanes (lanes.h); result: columns x columns, both triangles.
void gram(const float* J, int rows, int columns, float* result);

}  // namespace pencilscan
