#pragma once

#include <vector>

#include "pencilscan/surface/lattice.h"

namespace pencilscan {

/// What is known of a field at the nodes of a lattice.
struct FieldData {
  std::vector<float> target;  ///< per node: the value that it should have ...
  std::vector<float> weight;  ///< ... and how much that counts, in [0, 1]; 0: nothing is known
};

/// The field whose differences between neighbours are those of the targets, times the smaller
/// weight, and whose values are the targets, in the sense of least squares (inside_field.h). Nodes
/// that lack a neighbour keep what `values` says, drawn to the target by its weight. `values`:
/// first guess, and the result. Conjugate gradients, until nodes are off what their neighbours and
/// their target ask for by `tolerance`, root mean square; the bytes are the same for any thread
/// count. Returns the number of steps.
int solve_field(const Lattice& lattice, const FieldData& data, double tolerance,
                std::vector<float>& values);

}  // namespace pencilscan
