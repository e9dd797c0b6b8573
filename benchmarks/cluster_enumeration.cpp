#include "cluster_enumeration.h"

#include <algorithm>
#include <numeric>

namespace pencilscan {
namespace {

constexpr int kOpen = -1;  ///< label of a node that is not decided yet

class Enumeration {
 public:
  Enumeration(const PairwiseEnergy& energy, const ClusterOptions& options)
      : energy_(energy),
        options_(options),
        neighbors_(static_cast<std::size_t>(energy.nodes())),
        labels_(static_cast<std::size_t>(energy.nodes()), kOpen),
        is_clustered_(labels_.size(), 0),
        costs_(energy.unary.size(), 0.F) {
    for (const auto& edge : energy.edges) {
      neighbors_[static_cast<std::size_t>(edge.a)].push_back({edge.b, edge.table, true});
      neighbors_[static_cast<std::size_t>(edge.b)].push_back({edge.a, edge.table, false});
    }
  }

  std::vector<float> run() {
    // What is bound most first: later clusters lean on it.
    std::vector<int> order(labels_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return neighbors_[static_cast<std::size_t>(a)].size() >
             neighbors_[static_cast<std::size_t>(b)].size();
    });
    for (const int node : order) {
      if (is_clustered_[static_cast<std::size_t>(node)] == 0) solve(grow(node));
    }
    return std::move(costs_);
  }

 private:
  struct Neighbor {
    int node;
    std::size_t table;
    bool is_first;  ///< the table's rows are this node's labels
  };
  struct Trial {
    float energy;
    std::vector<int> labels;  ///< of the cluster's nodes
  };

  /// Connected open nodes, breadth first.
  std::vector<int> grow(int first) {
    std::vector<int> cluster = {first};
    is_clustered_[static_cast<std::size_t>(first)] = 1;
    for (std::size_t i = 0; i < cluster.size(); ++i) {
      for (const Neighbor& n : neighbors_[static_cast<std::size_t>(cluster[i])]) {
        if (static_cast<int>(cluster.size()) >= options_.max_size) return cluster;
        char& taken = is_clustered_[static_cast<std::size_t>(n.node)];
        if (taken != 0) continue;
        taken = 1;
        cluster.push_back(n.node);
      }
    }
    return cluster;
  }

  /// Cost of each label of a node, its decided neighbours given.
  void local_costs(int node, std::vector<float>& costs) const {
    const auto count = static_cast<std::size_t>(energy_.labels(node));
    const auto unary = energy_.unary.begin() + energy_.first[static_cast<std::size_t>(node)];
    costs.assign(unary, unary + static_cast<std::ptrdiff_t>(count));
    for (const Neighbor& n : neighbors_[static_cast<std::size_t>(node)]) {
      const int label = labels_[static_cast<std::size_t>(n.node)];
      if (label == kOpen) continue;
      const auto other = static_cast<std::size_t>(label);
      const auto others = static_cast<std::size_t>(energy_.labels(n.node));
      const float* table = energy_.tables.data() + n.table;
      for (std::size_t k = 0; k < count; ++k)
        costs[k] += n.is_first ? table[k * others + other] : table[other * count + k];
    }
  }

  /// Gives a node its best label; what that label costs.
  float decide(int node) {
    local_costs(node, scratch_);
    const auto best = std::min_element(scratch_.begin(), scratch_.end());
    labels_[static_cast<std::size_t>(node)] = static_cast<int>(best - scratch_.begin());
    return *best;
  }

  /// Energy of the cluster's decided nodes, edges to nodes decided before included.
  float energy_of(const std::vector<int>& cluster) {
    std::vector<int> kept;
    for (const int node : cluster) {
      kept.push_back(labels_[static_cast<std::size_t>(node)]);
      labels_[static_cast<std::size_t>(node)] = kOpen;
    }
    float sum = 0;
    for (std::size_t i = 0; i < cluster.size(); ++i) {
      local_costs(cluster[i], scratch_);
      sum += scratch_[static_cast<std::size_t>(kept[i])];
      labels_[static_cast<std::size_t>(cluster[i])] = kept[i];
    }
    return sum;
  }

  Trial try_label(const std::vector<int>& cluster, const std::vector<int>& order, int label) {
    for (const int node : cluster) labels_[static_cast<std::size_t>(node)] = kOpen;
    labels_[static_cast<std::size_t>(order[0])] = label;
    for (std::size_t i = 1; i < order.size(); ++i) decide(order[i]);
    for (int sweep = 0; sweep < options_.sweeps; ++sweep) {
      for (std::size_t i = 1; i < order.size(); ++i) decide(order[i]);
    }
    Trial trial{energy_of(cluster), {}};
    for (const int node : cluster) trial.labels.push_back(labels_[static_cast<std::size_t>(node)]);
    return trial;
  }

  /// The cluster's nodes from a seed outwards.
  [[nodiscard]] std::vector<int> order_from(const std::vector<int>& cluster, int seed) const {
    std::vector<int> order = {seed};
    std::vector<int> open = cluster;
    std::sort(open.begin(), open.end());
    std::erase(open, seed);
    for (std::size_t i = 0; i < order.size(); ++i) {
      for (const Neighbor& n : neighbors_[static_cast<std::size_t>(order[i])]) {
        const auto at = std::lower_bound(open.begin(), open.end(), n.node);
        if (at == open.end() || *at != n.node) continue;
        open.erase(at);
        order.push_back(n.node);
      }
    }
    return order;
  }

  void solve(const std::vector<int>& cluster) {
    std::vector<Trial> trials;
    const auto seeds = std::min(cluster.size(), static_cast<std::size_t>(options_.seeds));
    for (std::size_t s = 0; s < seeds; ++s) {
      const int seed = cluster[s * cluster.size() / seeds];
      const std::vector<int> order = order_from(cluster, seed);
      for (int label = 0; label < energy_.labels(seed); ++label)
        trials.push_back(try_label(cluster, order, label));
    }
    const auto best =
        std::min_element(trials.begin(), trials.end(),
                         [](const Trial& a, const Trial& b) { return a.energy < b.energy; });
    for (std::size_t i = 0; i < cluster.size(); ++i)
      labels_[static_cast<std::size_t>(cluster[i])] = best->labels[i];
    // Of each label: the best trial that has it, or the best one with this node changed alone.
    for (std::size_t i = 0; i < cluster.size(); ++i) {
      local_costs(cluster[i], scratch_);
      const float own = scratch_[static_cast<std::size_t>(best->labels[i])];
      float* costs = costs_.data() + energy_.first[static_cast<std::size_t>(cluster[i])];
      for (std::size_t k = 0; k < scratch_.size(); ++k) costs[k] = scratch_[k] - own;
      for (const Trial& trial : trials) {
        float& cost = costs[trial.labels[i]];
        cost = std::min(cost, trial.energy - best->energy);
      }
    }
  }

  const PairwiseEnergy& energy_;
  const ClusterOptions& options_;
  std::vector<std::vector<Neighbor>> neighbors_;
  std::vector<int> labels_;
  std::vector<char> is_clustered_;
  std::vector<float> costs_;
  std::vector<float> scratch_;
};

}  // namespace

std::vector<float> enumerate_clusters(const PairwiseEnergy& energy, const ClusterOptions& options) {
  return Enumeration(energy, options).run();
}

}  // namespace pencilscan
