#include "pencilscan/joint/stretches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

const PieceLabel& label_of(const LabelledPieces& pieces, const std::vector<Decision>& decisions,
                           std::size_t piece) {
  return pieces.labels[piece][static_cast<std::size_t>(decisions[piece].label)];
}

/// All lines that some piece of a stretch may show.
std::vector<PatternLine> lines_of(const LabelledPieces& pieces, const Stretch& stretch) {
  std::vector<PatternLine> lines;
  for (std::size_t p = stretch.first; p <= stretch.last; ++p)
    for (const PieceLabel& label : pieces.labels[p]) lines.push_back(label.of());
  std::sort(lines.begin(), lines.end());
  lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
  return lines;
}

/// For each line, the index of that label of the piece; "outlier" where it has none.
std::vector<std::size_t> labels_of_lines(const std::vector<PieceLabel>& labels,
                                         const std::vector<PatternLine>& lines) {
  std::vector<std::size_t> result;
  std::size_t k = 0;  // both are ordered
  for (const PatternLine& line : lines) {
    while (k < labels.size() && labels[k].of() < line) ++k;
    const bool has = k < labels.size() && labels[k].of() == line;
    result.push_back(has ? k : labels.size());
  }
  return result;
}

float median_height(const GridGraph& graph, const CurvePiece& piece) {
  const auto& points = graph.curves[static_cast<std::size_t>(piece.curve)].points;
  std::vector<float> heights;
  for (int i = piece.begin; i < piece.end; ++i)
    heights.push_back(points[static_cast<std::size_t>(i)].amplitude);
  return upper_median(std::move(heights));
}

}  // namespace

std::vector<Decision> decisions_of(const LabelledPieces& pieces, std::span<const float> costs) {
  std::vector<Decision> decisions;
  std::size_t at = 0;
  for (const auto& labels : pieces.labels) {
    const std::size_t n = labels.size() + 1;
    std::size_t best = n - 1;
    for (std::size_t k = 0; k < n; ++k) {
      if (costs[at + k] < costs[at + best]) best = k;
    }
    float second = 1e9F;
    for (std::size_t k = 0; k < n; ++k) {
      if (k != best) second = std::min(second, costs[at + k]);
    }
    decisions.push_back({best + 1 == n ? -1 : static_cast<int>(best), second - costs[at + best]});
    at += n;
  }
  return decisions;
}

std::vector<Stretch> same_line_stretches(const LabelledPieces& pieces,
                                         const std::vector<Decision>& decisions) {
  std::vector<Stretch> stretches;
  const auto& list = pieces.graph.pieces;
  for (std::size_t p = 0; p < list.size(); ++p) {
    if (decisions[p].label < 0) continue;
    const bool goes_on =
        !stretches.empty() && stretches.back().last + 1 == p &&
        list[p - 1].curve == list[p].curve &&
        label_of(pieces, decisions, p - 1).of() == label_of(pieces, decisions, p).of();
    if (goes_on) {
      stretches.back().last = p;
    } else {
      stretches.push_back({p, p});
    }
  }
  return stretches;
}

TiedEnergy tie_pieces(const LabelledPieces& pieces, const PairwiseEnergy& energy,
                      std::span<const Stretch> stretches) {
  TiedEnergy tied;
  tied.energy.first.push_back(0);
  std::vector<int> stretch_of(pieces.labels.size(), -1);
  std::vector<std::vector<std::size_t>> label(pieces.labels.size());  // per line of its stretch
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    const auto& lines = tied.lines.emplace_back(lines_of(pieces, stretches[s]));
    std::vector<float> unary(lines.size(), 0.F);
    for (std::size_t p = stretches[s].first; p <= stretches[s].last; ++p) {
      stretch_of[p] = static_cast<int>(s);
      label[p] = labels_of_lines(pieces.labels[p], lines);
      const auto first = static_cast<std::size_t>(energy.first[p]);
      for (std::size_t l = 0; l < lines.size(); ++l) unary[l] += energy.unary[first + label[p][l]];
    }
    tied.energy.unary.insert(tied.energy.unary.end(), unary.begin(), unary.end());
    tied.energy.first.push_back(static_cast<int>(tied.energy.unary.size()));
  }
  std::map<std::pair<int, int>, std::size_t> edge_of;
  for (const PairwiseEnergy::Edge& edge : energy.edges) {
    const auto a = static_cast<std::size_t>(edge.a);
    const auto b = static_cast<std::size_t>(edge.b);
    const int sa = stretch_of[a];
    const int sb = stretch_of[b];
    if (sa < 0 || sb < 0) continue;
    const float* table = energy.tables.data() + edge.table;
    const std::size_t columns = pieces.labels[b].size() + 1;
    const auto cost = [&](std::size_t la, std::size_t lb) {
      return table[label[a][la] * columns + label[b][lb]];
    };
    if (sa == sb) {
      float* unary = tied.energy.unary.data() + tied.energy.first[static_cast<std::size_t>(sa)];
      for (std::size_t l = 0; l < label[a].size(); ++l) unary[l] += cost(l, l);
      continue;
    }
    const auto ends = std::minmax(sa, sb);
    const auto [known, is_new] = edge_of.try_emplace({ends.first, ends.second}, 0);
    if (is_new) {
      known->second = tied.energy.tables.size();
      tied.energy.edges.push_back({ends.first, ends.second, known->second});
      tied.energy.tables.resize(known->second + label[a].size() * label[b].size(), 0.F);
    }
    float* sum = tied.energy.tables.data() + known->second;
    const std::size_t stride = sa < sb ? label[b].size() : label[a].size();
    for (std::size_t la = 0; la < label[a].size(); ++la) {
      for (std::size_t lb = 0; lb < label[b].size(); ++lb)
        sum[sa < sb ? la * stride + lb : lb * stride + la] += cost(la, lb);
    }
  }
  return tied;
}

std::vector<float> margins_of_stretches(const LabelledPieces& pieces, const PairwiseEnergy& energy,
                                        const std::vector<Decision>& decisions, int rounds,
                                        float damping) {
  const std::vector<Stretch> stretches = same_line_stretches(pieces, decisions);
  const TiedEnergy tied = tie_pieces(pieces, energy, stretches);
  const std::vector<float> costs = min_sum(tied.energy, rounds, damping);
  std::vector<float> margins(decisions.size(), 0.F);
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    const PatternLine line = label_of(pieces, decisions, stretches[s].first).of();
    const float* cost = costs.data() + tied.energy.first[s];
    float own = 0;
    float other = std::numeric_limits<float>::max();
    for (std::size_t l = 0; l < tied.lines[s].size(); ++l) {
      if (tied.lines[s][l] == line) {
        own = cost[l];
      } else {
        other = std::min(other, cost[l]);
      }
    }
    for (std::size_t p = stretches[s].first; p <= stretches[s].last; ++p)
      margins[p] = std::max(0.F, other - own);
  }
  return margins;
}

std::vector<char> faint_pieces(const GridGraph& graph, const LabelledPieces& pieces,
                               std::span<const NextPiece> beside,
                               const std::vector<Decision>& decisions) {
  // Share of the height of a line beside it. Second images have .1 to .25 of it. The value is not
  // critical: from .25 to .55, as many lines of twelve objects are named, and as many are wrong.
  constexpr float kFaint = 0.3F;
  const std::size_t count = decisions.size();
  std::vector<float> height;
  for (const CurvePiece& piece : pieces.graph.pieces) height.push_back(median_height(graph, piece));
  std::vector<float> beside_it(count, 0.F);
  const auto raise = [&](int p, int other) {
    float& highest = beside_it[static_cast<std::size_t>(p)];
    highest = std::max(highest, height[static_cast<std::size_t>(other)]);
  };
  for (const NextPiece& next : beside) {
    raise(next.a, next.b);
    raise(next.b, next.a);
  }
  std::vector<char> faint(count, 0);
  for (std::size_t p = 0; p < count; ++p) faint[p] = height[p] < kFaint * beside_it[p] ? 1 : 0;
  for (const auto& [first, last] : same_line_stretches(pieces, decisions)) {
    const auto begin = faint.begin() + static_cast<std::ptrdiff_t>(first);
    const auto end = faint.begin() + static_cast<std::ptrdiff_t>(last + 1);
    const bool is_faint = 2 * std::count(begin, end, 1) > end - begin;
    std::fill(begin, end, is_faint ? 1 : 0);
  }
  return faint;
}

void leave_periodic(const Rig& rig, const LabelledPieces& pieces, const PairwiseEnergy& energy,
                    std::vector<Decision>& decisions) {
  for (const Stretch& stretch : same_line_stretches(pieces, decisions)) {
    const PatternLine best = label_of(pieces, decisions, stretch.first).of();
    const int period = rig.pattern(best.pattern).period();
    const std::vector<PatternLine> lines = lines_of(pieces, stretch);
    std::vector<float> costs(lines.size(), 0.F);
    std::vector<char> is_possible(lines.size(), 1);
    for (std::size_t p = stretch.first; p <= stretch.last; ++p) {
      const std::vector<std::size_t> labels = labels_of_lines(pieces.labels[p], lines);
      const float* unary = energy.unary.data() + energy.first[p];
      for (std::size_t l = 0; l < lines.size(); ++l) {
        costs[l] += unary[labels[l]];
        if (labels[l] == pieces.labels[p].size()) is_possible[l] = 0;
      }
    }
    const auto own = static_cast<std::size_t>(std::lower_bound(lines.begin(), lines.end(), best) -
                                              lines.begin());
    float margin = std::numeric_limits<float>::max();
    for (std::size_t l = 0; l < lines.size(); ++l) {
      const int apart = std::abs(lines[l].line - best.line);
      if (l == own || !(lines[l].pattern == best.pattern) || apart % period != 0) continue;
      if (is_possible[l] != 0) margin = std::min(margin, costs[l] - costs[own]);
    }
    for (std::size_t p = stretch.first; p <= stretch.last; ++p)
      decisions[p].margin = std::min(decisions[p].margin, std::max(0.F, margin));
  }
}

}  // namespace pencilscan
