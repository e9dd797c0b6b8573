#include "pencilscan/joint/anchors.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

namespace pencilscan {
namespace {

int curve_of(const PieceGraph& graph, int piece) {
  return graph.pieces[static_cast<std::size_t>(piece)].curve;
}

/// The label that a piece was given; null: none.
const PieceLabel* decided(const LabelledPieces& pieces, const std::vector<Decision>& decisions,
                          int piece) {
  const auto p = static_cast<std::size_t>(piece);
  const int label = decisions[p].label;
  return label < 0 ? nullptr : &pieces.labels[p][static_cast<std::size_t>(label)];
}

/// Per piece, 1 where a crossing bears its line out: by itself, or in a pair (held_pieces()). Lines
/// of a room go on where the object's end, and give chance more of them to choose from: without a
/// room, pairs are as good as others.
struct Crossed {
  std::vector<char> is_crossed;
  std::vector<char> is_paired;
};

Crossed crossed_by_lines(const LabelledPieces& pieces, const JointOptions& options,
                         const std::vector<Decision>& decisions) {
  const CrossingCost crossing_cost(pieces, options);
  std::vector<const PieceCrossing*> agreeing;
  std::map<int, std::set<int>> agrees_with;  // curves
  for (const PieceCrossing& x : pieces.graph.crossings) {
    const PieceLabel* a = decided(pieces, decisions, x.a);
    const PieceLabel* b = decided(pieces, decisions, x.b);
    // Below 0 the crossing is likelier where both lines are right than by chance.
    if (a == nullptr || b == nullptr || crossing_cost(*a, *b, x) >= 0) continue;
    agreeing.push_back(&x);
    agrees_with[curve_of(pieces.graph, x.a)].insert(curve_of(pieces.graph, x.b));
    agrees_with[curve_of(pieces.graph, x.b)].insert(curve_of(pieces.graph, x.a));
  }
  Crossed crossed{std::vector<char>(decisions.size(), 0), std::vector<char>(decisions.size(), 0)};
  for (const PieceCrossing* x : agreeing) {
    const bool is_pair = pieces.shows_room &&
                         agrees_with[curve_of(pieces.graph, x->a)].size() == 1 &&
                         agrees_with[curve_of(pieces.graph, x->b)].size() == 1;
    std::vector<char>& by = is_pair ? crossed.is_paired : crossed.is_crossed;
    for (const int p : {x->a, x->b}) by[static_cast<std::size_t>(p)] = 1;
  }
  return crossed;
}

}  // namespace

std::vector<char> held_pieces(const PieceGraph& graph, const std::vector<std::vector<int>>& linked,
                              std::vector<char> is_crossed, const std::vector<char>& is_paired,
                              const std::function<bool(std::span<const int> group)>& is_ambiguous) {
  std::vector<char> is_held = std::move(is_crossed);
  // Along curves.
  std::vector<int> open;
  for (std::size_t p = 0; p < is_held.size(); ++p) {
    if (is_held[p] != 0) open.push_back(static_cast<int>(p));
  }
  while (!open.empty()) {
    const int p = open.back();
    open.pop_back();
    for (const int q : linked[static_cast<std::size_t>(p)]) {
      if (is_held[static_cast<std::size_t>(q)] != 0 || curve_of(graph, p) != curve_of(graph, q))
        continue;
      is_held[static_cast<std::size_t>(q)] = 1;
      open.push_back(q);
    }
  }
  // Groups of the others.
  const std::vector<char> by_itself = is_held;
  std::vector<char> is_seen = by_itself;
  for (std::size_t first = 0; first < is_held.size(); ++first) {
    if (is_seen[first] != 0) continue;
    is_seen[first] = 1;
    std::vector<int> group{static_cast<int>(first)};
    std::set<int> holding;
    bool has_pair = false;
    for (std::size_t k = 0; k < group.size(); ++k) {
      has_pair = has_pair || is_paired[static_cast<std::size_t>(group[k])] != 0;
      for (const int q : linked[static_cast<std::size_t>(group[k])]) {
        const auto j = static_cast<std::size_t>(q);
        if (by_itself[j] != 0) holding.insert(curve_of(graph, q));
        if (is_seen[j] != 0) continue;
        is_seen[j] = 1;
        group.push_back(q);
      }
    }
    if ((holding.empty() && !has_pair) || (holding.size() < 2 && is_ambiguous(group))) continue;
    for (const int p : group) is_held[static_cast<std::size_t>(p)] = 1;
  }
  return is_held;
}

bool is_ambiguous_group(const LabelledPieces& pieces, const std::vector<Decision>& decisions,
                        const JointOptions& options, std::span<const int> group) {
  constexpr std::size_t kWord = 3;  // lines of a code word of the paper; fewer have no code
  const auto wrong_color = static_cast<float>(options.max_color_cost);
  const auto labels_of = [&](int p) -> const std::vector<PieceLabel>& {
    return pieces.labels[static_cast<std::size_t>(p)];
  };
  const auto own = [&](int p) -> const PieceLabel& {
    return labels_of(p)[static_cast<std::size_t>(decisions[static_cast<std::size_t>(p)].label)];
  };
  std::set<int> curves;
  for (const int p : group) curves.insert(curve_of(pieces.graph, p));
  if (curves.size() <= kWord) return false;
  const int first = group.front();
  for (const PieceLabel& other : labels_of(first)) {
    const int apart = other.line - own(first).line;
    if (other.pattern == own(first).pattern && apart == 0) continue;
    float more = 0;
    for (const int p : group) {
      const auto found =
          std::find_if(labels_of(p).begin(), labels_of(p).end(), [&](const PieceLabel& label) {
            return label.pattern == other.pattern && label.line == own(p).line + apart;
          });
      more += found == labels_of(p).end() ? wrong_color : found->cost - own(p).cost;
    }
    if (more < 0.5F * wrong_color) return true;
  }
  return false;
}

Anchors find_anchors(const LabelledPieces& pieces, std::span<const NextPiece> beside,
                     const JointOptions& options, const std::vector<Decision>& decisions) {
  Anchors anchors;
  anchors.linked.resize(decisions.size());
  anchors.neighbors.resize(decisions.size(), 0);
  const auto link = [&](int a, int b, int lines_apart) {
    const PieceLabel* la = decided(pieces, decisions, a);
    const PieceLabel* lb = decided(pieces, decisions, b);
    if (la == nullptr || lb == nullptr || !(la->pattern == lb->pattern) ||
        std::abs(la->line - lb->line) != lines_apart)
      return;
    anchors.linked[static_cast<std::size_t>(a)].push_back(b);
    anchors.linked[static_cast<std::size_t>(b)].push_back(a);
    anchors.neighbors[static_cast<std::size_t>(a)] += lines_apart;
    anchors.neighbors[static_cast<std::size_t>(b)] += lines_apart;
  };
  for (const NextPiece& next : beside) link(next.a, next.b, 1);
  for (const auto& [a, b] : pieces.graph.continuations) link(a, b, 0);
  Crossed crossed = crossed_by_lines(pieces, options, decisions);
  anchors.is_held = held_pieces(pieces.graph, anchors.linked, std::move(crossed.is_crossed),
                                crossed.is_paired, [&](std::span<const int> group) {
                                  return is_ambiguous_group(pieces, decisions, options, group);
                                });
  return anchors;
}

void leave_unanchored(const Anchors& anchors, std::vector<Decision>& decisions) {
  constexpr float kPerNeighbor = 3;  // what one adds to the margin, about
  for (std::size_t p = 0; p < decisions.size(); ++p) {
    if (anchors.is_held[p] == 0)
      decisions[p].margin -= kPerNeighbor * static_cast<float>(anchors.neighbors[p]);
  }
}

}  // namespace pencilscan
