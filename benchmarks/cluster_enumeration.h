#pragma once

#include "pencilscan/joint/min_sum.h"

namespace pencilscan {

struct ClusterOptions {
  int max_size = 48;  ///< nodes of a cluster; >= 1
  int seeds = 3;      ///< nodes of a cluster whose labels are tried; >= 1
  int sweeps = 2;     ///< of single-node improvements of every trial; >= 0
};

/// Approximate min-marginals of every label, laid out as `unary`, by enumeration: in the manner of
/// Sagawa et al. (ICCV 2011), who solve for the integers of one region after the other. Connected
/// nodes are cut into clusters; as crossings bind the labels of a cluster to each other, each label
/// of a seed node, passed on from neighbour to neighbour, gives one trial for all of them. The best
/// trial of each cluster is kept, its neighbours' decisions given.
[[nodiscard]] std::vector<float> enumerate_clusters(const PairwiseEnergy& energy,
                                                    const ClusterOptions& options = {});

}  // namespace pencilscan
