#include "pencilscan/joint/joint.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/core/parallel.h"
#include "pencilscan/grid/local_ids.h"
#include "pencilscan/joint/anchors.h"
#include "pencilscan/joint/darkness.h"
#include "pencilscan/joint/ghosts_before_room.h"
#include "pencilscan/joint/min_sum.h"
#include "pencilscan/joint/next_lines.h"
#include "pencilscan/joint/other_views.h"
#include "pencilscan/joint/piece_labels.h"
#include "pencilscan/joint/room_readings.h"
#include "pencilscan/joint/stretches.h"
#include "pencilscan/joint/surroundings.h"

namespace pencilscan {
namespace {

/// Cost of the label "no line". The costs of all other labels are relative to it: a piece has no
/// line where even the best of them costs more.
constexpr float kOutlierCost = 0;
/// Reward of two consecutive pieces of one curve that show the same line, as a log-likelihood. A
/// jump to another line loses it and costs JointOptions::change_cost, together 6. So all other
/// evidence has to prefer the jump by e^6 = 400 to 1. Where nothing crosses, the curve itself is
/// the best evidence. There the sum is 11. Both rewards are chosen, no fit of them is kept.
/// experiments/one_projector.py shows what the second one does.
constexpr float kSameLineReward = 2;
constexpr float kSameUncrossedReward = 7;

/// Adds a table over the labels of two pieces, each with "outlier" as its last label (cost 0).
template <class Cost>
void add_edge(PairwiseEnergy& energy, int a, int b, const std::vector<PieceLabel>& labels_a,
              const std::vector<PieceLabel>& labels_b, Cost cost) {
  const std::size_t table = energy.tables.size();
  energy.edges.push_back({a, b, table});
  energy.tables.resize(table + (labels_a.size() + 1) * (labels_b.size() + 1), 0.F);
  float* entry = energy.tables.data() + table;
  for (const PieceLabel& la : labels_a) {
    for (const PieceLabel& lb : labels_b) *entry++ = cost(la, lb);
    ++entry;
  }
}

void add(const std::vector<std::vector<float>>& costs, std::vector<std::vector<float>>& sum) {
  for (std::size_t p = 0; p < sum.size(); ++p) {
    for (std::size_t k = 0; k < sum[p].size(); ++k) sum[p][k] += costs[p][k];
  }
}

void set_unary(const LabelledPieces& pieces, const std::vector<std::vector<float>>& views,
               PairwiseEnergy& energy) {
  energy.unary.clear();
  for (std::size_t p = 0; p < pieces.labels.size(); ++p) {
    for (std::size_t k = 0; k < pieces.labels[p].size(); ++k)
      energy.unary.push_back(pieces.labels[p][k].cost + views[p][k]);
    energy.unary.push_back(kOutlierCost);
  }
}

PairwiseEnergy pairwise_energy(const LabelledPieces& pieces, const JointOptions& options) {
  PairwiseEnergy energy;
  energy.first.push_back(0);
  for (const auto& labels : pieces.labels)
    energy.first.push_back(energy.first.back() + static_cast<int>(labels.size()) + 1);
  std::size_t size = 0;
  const auto add_size = [&](int a, int b) {
    size += static_cast<std::size_t>(energy.labels(a)) * static_cast<std::size_t>(energy.labels(b));
  };
  for (const PieceCrossing& x : pieces.graph.crossings) add_size(x.a, x.b);
  for (const auto& [a, b] : pieces.graph.continuations) add_size(a, b);
  energy.tables.reserve(size);
  const CrossingCost crossing_cost(pieces, options);
  for (const PieceCrossing& x : pieces.graph.crossings) {
    add_edge(energy, x.a, x.b, pieces.labels[static_cast<std::size_t>(x.a)],
             pieces.labels[static_cast<std::size_t>(x.b)],
             [&](const PieceLabel& a, const PieceLabel& b) { return crossing_cost(a, b, x); });
  }
  const float same_line = lacks_crossings(pieces.graph) ? kSameUncrossedReward : kSameLineReward;
  for (const auto& [a, b] : pieces.graph.continuations) {
    add_edge(energy, a, b, pieces.labels[static_cast<std::size_t>(a)],
             pieces.labels[static_cast<std::size_t>(b)],
             [&](const PieceLabel& la, const PieceLabel& lb) {
               return la.pattern == lb.pattern && la.line == lb.line
                          ? -same_line
                          : static_cast<float>(options.change_cost);
             });
  }
  return energy;
}

/// Adds what darkness in other cameras says to the labels' own costs.
void add_darkness(const Rig& rig, std::span<const GridGraph> graphs,
                  std::vector<LabelledPieces>& pieces) {
  const Darkness darkness(rig, graphs, pieces);
  for (std::size_t g = 0; g < graphs.size(); ++g) {
    const auto costs = darkness.costs(g);
    add(costs, pieces[g].scores);
    for (std::size_t p = 0; p < costs.size(); ++p)
      for (std::size_t k = 0; k < costs[p].size(); ++k) pieces[g].labels[p][k].cost += costs[p][k];
  }
}

/// Leaves out labels that the other cameras make hopeless (`views`: what they cost there). Time and
/// memory of all that follows grow with the square of the number of labels. Returns what becomes of
/// each (OtherViews::forget).
std::vector<std::vector<int>> forget_unseen(const std::vector<std::vector<float>>& views,
                                            const JointOptions& options, LabelledPieces& pieces) {
  std::vector<std::vector<int>> new_index;
  const float behind = largest_gap(pieces.graph, options);
  for (std::size_t p = 0; p < pieces.labels.size(); ++p) {
    auto& labels = pieces.labels[p];
    std::vector<int>& index = new_index.emplace_back(labels.size(), -1);
    std::vector<float>& costs = pieces.scores[p];
    for (std::size_t k = 0; k < costs.size(); ++k) costs[k] += views[p][k];
    int kept = 0;
    for (const std::size_t k : labels_worth_keeping(costs, labels.size(), behind)) {
      labels[static_cast<std::size_t>(kept)] = labels[k];
      index[k] = kept++;
    }
    labels.resize(static_cast<std::size_t>(kept));
  }
  pieces.scores.clear();
  return new_index;
}

/// Where nothing crosses: pieces side by side are lines side by side.
void add_order(const Rig& rig, const GridGraph& graph, const LabelledPieces& pieces,
               std::span<const NextPiece> beside, PairwiseEnergy& energy) {
  const Camera& camera = rig.camera(graph.camera);
  const bool decides = lacks_crossings(pieces.graph);
  for (const NextPiece& next : beside) {
    const auto& a = pieces.labels[static_cast<std::size_t>(next.a)];
    const auto& b = pieces.labels[static_cast<std::size_t>(next.b)];
    const Vec3 ray = camera.normalized_from_pixel(next.pixel.cast<double>()).homogeneous();
    PatternRef known{-1, -1};
    int order = 0;
    add_edge(energy, next.a, next.b, a, b, [&](const PieceLabel& la, const PieceLabel& lb) {
      if (!(la.pattern == known)) {  // labels are ordered by pattern
        known = la.pattern;
        const double depth = 1 / la.q.cast<double>().dot(ray);
        order = line_order_sign(rig, camera, known, next.pixel.cast<double>(),
                                next.tangent.cast<double>(), depth);
        if (next.side < 0) order = -order;
      }
      return decides ? next_uncrossed_cost(la, lb, order) : next_piece_cost(la, lb, order);
    });
  }
}

/// Takes back what add_order added.
void remove_order(const LabelledPieces& pieces, PairwiseEnergy& energy) {
  const std::size_t own = pieces.graph.crossings.size() + pieces.graph.continuations.size();
  if (own >= energy.edges.size()) return;
  energy.tables.resize(energy.edges[own].table);
  energy.edges.resize(own);
}

/// Beliefs as probabilities of each label; what is missing to 1 is "outlier".
PieceBeliefs beliefs_of(const LabelledPieces& pieces, const std::vector<float>& costs) {
  constexpr float kTemperature = 2;  // loops count evidence more than once
  PieceBeliefs beliefs;
  std::size_t at = 0;
  for (const auto& labels : pieces.labels) {
    const auto first = costs.begin() + static_cast<std::ptrdiff_t>(at);
    const auto last = first + static_cast<std::ptrdiff_t>(labels.size() + 1);
    const float lowest = *std::min_element(first, last);
    float sum = 0;
    std::vector<float> p;
    for (auto it = first; it != last; ++it) {
      p.push_back(std::exp((lowest - *it) / kTemperature));
      sum += p.back();
    }
    p.pop_back();
    for (float& x : p) x /= sum;
    beliefs.push_back(std::move(p));
    at += labels.size() + 1;
  }
  return beliefs;
}

/// Where nothing crosses, lines are wrong together: a few curves beside a step in depth or beside a
/// ghost, each of them held by the next. So a line is as sure as the least sure of three opinions:
/// that of pieces, that of whole stretches, and that of stretches if faint ones are ghosts. Leaves
/// the energy of the third behind.
void ask_stretches(const Rig& rig, const GridGraph& graph, const LabelledPieces& pieces,
                   std::span<const NextPiece> beside, const JointOptions& options,
                   PairwiseEnergy& energy, std::vector<Decision>& decisions) {
  const auto margins_without = [&](std::span<const char> left_out) {
    constexpr int kRounds = 60;  // of messages: across as many curves
    std::vector<Decision> asked = decisions;
    for (std::size_t p = 0; p < left_out.size(); ++p) {
      if (left_out[p] != 0) asked[p].label = -1;
    }
    return margins_of_stretches(pieces, energy, asked, kRounds,
                                static_cast<float>(options.damping));
  };
  const std::vector<float> of_all = margins_without({});
  const std::vector<char> faint = faint_pieces(graph, pieces, beside, decisions);
  const Camera& camera = rig.camera(graph.camera);
  remove_order(pieces, energy);
  add_order(rig, graph, pieces,
            next_pieces(camera, graph, pieces.graph, next_line_reach_px(rig, camera), faint),
            energy);
  const std::vector<float> of_bright = margins_without(faint);
  for (std::size_t p = 0; p < decisions.size(); ++p) {
    float& margin = decisions[p].margin;
    margin = std::min(margin, of_all[p]);
    if (faint[p] == 0) margin = std::min(margin, of_bright[p]);
  }
}

/// What is believed of pieces that something holds; nothing of the others.
PieceBeliefs of_held(PieceBeliefs beliefs, const Anchors& anchors) {
  for (std::size_t p = 0; p < beliefs.size(); ++p) {
    if (anchors.is_held[p] == 0) std::fill(beliefs[p].begin(), beliefs[p].end(), 0.F);
  }
  return beliefs;
}

/// Share of points that are right at this margin: a logistic fit over five rendered scenes (bunny
/// with and without texture, hand, two balls, cube); benchmarks/accuracy prints the comparison.
float confidence_of(float margin) { return 1 / (1 + std::exp(0.13F - 0.52F * margin)); }
/// The same where nothing crosses: lines are wrong together, a few curves at a time, and margins
/// say less of that. Of experiments/one_projector.py --fit, over 36 objects in five settings; other
/// draws of them judge it.
float uncrossed_confidence_of(float margin) { return 1 / (1 + std::exp(0.085F - 0.348F * margin)); }

/// Runs of the decided pieces of one camera, and why the others are not.
void write_decisions(const LabelledPieces& pieces, const std::vector<Decision>& decisions,
                     const JointOptions& options, std::vector<LabeledRun>& runs,
                     std::vector<LabeledRun>& tentative, std::vector<UndecidedRun>& undecided) {
  const std::vector<char> is_crossed = crossed_pieces(pieces.graph);
  const bool lacks = lacks_crossings(pieces.graph);
  const auto least =
      static_cast<float>(lacks ? options.min_uncrossed_confidence : options.min_confidence);
  for (std::size_t p = 0; p < decisions.size(); ++p) {
    const CurvePiece& piece = pieces.graph.pieces[p];
    const auto leave = [&](UndecidedReason reason) {
      undecided.push_back({piece.curve, piece.begin, piece.end, reason});
    };
    const float margin = decisions[p].margin;
    const float confidence = lacks ? uncrossed_confidence_of(margin) : confidence_of(margin);
    const bool is_sure = decisions[p].label >= 0 && confidence >= least;
    if (pieces.labels[p].empty() || (pieces.meets_volume[p] == 0 && !is_sure)) {
      leave(UndecidedReason::kOutsideVolume);
      continue;
    }
    if (decisions[p].label >= 0) {
      const PieceLabel& label = pieces.labels[p][static_cast<std::size_t>(decisions[p].label)];
      (is_sure ? runs : tentative)
          .push_back(
              {piece.curve, piece.begin, piece.end,
               CurveLabel{label.pattern, label.line, static_cast<double>(label.line), confidence}});
      if (is_sure) continue;
    }
    leave(is_crossed[p] == 0       ? UndecidedReason::kNoCrossing
          : decisions[p].label < 0 ? UndecidedReason::kContradicted
                                   : UndecidedReason::kAmbiguous);
  }
}

/// Labels that no other camera confirms leave before pieces' labels meet in tables.
void forget_unseen_labels(const JointOptions& options, OtherViews& others,
                          std::vector<LabelledPieces>& pieces) {
  std::vector<std::vector<std::vector<int>>> new_index(pieces.size());
  parallel_for(pieces.size(), [&](std::size_t g) {
    const std::vector<PieceBeliefs> no_beliefs(pieces.size());
    new_index[g] = forget_unseen(others.costs(g, no_beliefs), options, pieces[g]);
  });
  others.forget(new_index);
}

Labeling written(const Rig& rig, std::span<const GridGraph> graphs,
                 const std::vector<LabelledPieces>& pieces,
                 const std::vector<std::vector<Decision>>& decisions, const JointOptions& options) {
  Labeling labeling;
  labeling.runs.resize(rig.cameras.size());
  labeling.tentative.resize(rig.cameras.size());
  labeling.undecided.resize(rig.cameras.size());
  for (std::size_t g = 0; g < graphs.size(); ++g) {
    const auto camera = static_cast<std::size_t>(graphs[g].camera);
    write_decisions(pieces[g], decisions[g], options, labeling.runs[camera],
                    labeling.tentative[camera], labeling.undecided[camera]);
  }
  return labeling;
}

}  // namespace

float JointOptions::disagreement_cost() const {
  return static_cast<float>(-std::log(crossing_outliers));
}

Labeling solve_joint(const Rig& rig, const std::vector<ColorFamily>& families,
                     std::span<const GridGraph> graphs, const JointOptions& options) {
  std::vector<LabelledPieces> pieces(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    pieces[g] = possible_labels(rig, families, graphs[g], options);
  });
  add_darkness(rig, graphs, pieces);
  OtherViews others(rig, graphs, pieces);
  forget_unseen_labels(options, others, pieces);
  std::vector<std::optional<Surroundings>> surroundings(graphs.size());
  std::vector<PairwiseEnergy> energies(graphs.size());
  std::vector<std::vector<NextPiece>> beside(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) {
    const Camera& camera = rig.camera(graphs[g].camera);
    // Where nothing crosses, a step in depth would be taken for a line that was missed.
    if (!lacks_crossings(pieces[g].graph)) surroundings[g].emplace(camera, graphs[g], pieces[g]);
    energies[g] = pairwise_energy(pieces[g], options);
    beside[g] = next_pieces(camera, graphs[g], pieces[g].graph, next_line_reach_px(rig, camera));
    add_order(rig, graphs[g], pieces[g], beside[g], energies[g]);
  });
  std::vector<std::vector<Decision>> decisions(graphs.size());
  std::vector<PieceBeliefs> beliefs(graphs.size());
  std::vector<std::vector<std::vector<float>>> views(graphs.size());  // of cameras with a room
  for (int pass = 0; pass < options.passes; ++pass) {
    std::vector<PieceBeliefs> next(graphs.size());
    parallel_for(graphs.size(), [&](std::size_t g) {
      auto evidence = others.costs(g, beliefs);
      if (pieces[g].shows_room) views[g] = evidence;
      if (surroundings[g]) add(surroundings[g]->costs(beliefs[g]), evidence);
      set_unary(pieces[g], evidence, energies[g]);
      // Order and code reach a piece over as many neighbours as the code is long, and more.
      const int rounds = lacks_crossings(pieces[g].graph) ? 6 * options.rounds : options.rounds;
      const std::vector<float> costs =
          options.inference ? options.inference(energies[g])
                            : min_sum(energies[g], rounds, static_cast<float>(options.damping));
      next[g] = beliefs_of(pieces[g], costs);
      decisions[g] = decisions_of(pieces[g], costs);
    });
    beliefs = std::move(next);
  }
  const ObjectSpace space(rig);
  parallel_for(graphs.size(), [&](std::size_t g) {
    const Camera& camera = rig.camera(graphs[g].camera);
    if (lacks_crossings(pieces[g].graph)) {
      ask_stretches(rig, graphs[g], pieces[g], beside[g], options, energies[g], decisions[g]);
      leave_periodic(rig, pieces[g], energies[g], decisions[g]);
    } else {
      const Anchors anchors = find_anchors(pieces[g], beside[g], options, decisions[g]);
      leave_unanchored(anchors, decisions[g]);
      if (pieces[g].shows_room) {
        add(surroundings[g]->costs(of_held(beliefs[g], anchors)), views[g]);
        give_to_room(camera, pieces[g], anchors, views[g], space, options, decisions[g]);
      }
    }
    leave_ghosts_before_room(camera, pieces[g], space, options, decisions[g]);
  });
  return written(rig, graphs, pieces, decisions, options);
}

}  // namespace pencilscan
