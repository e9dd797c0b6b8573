#include "pencilscan/joint/piece_labels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pencilscan/detection/code_evidence.h"
#include "pencilscan/grid/line_candidates.h"
#include "pencilscan/joint/floor_cost.h"
#include "pencilscan/joint/next_lines.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// Cost of each colour of the family, the best 0.
std::vector<float> color_costs(const Curve& curve, const CurvePiece& piece, std::size_t colors,
                               const JointOptions& options) {
  std::vector<float> evidence = color_evidence(curve, piece.begin, piece.end, colors);
  const float best = *std::max_element(evidence.begin(), evidence.end());
  for (float& e : evidence) e = std::min(best - e, static_cast<float>(options.max_color_cost));
  return evidence;
}

/// How the surface would run along the piece: depth change per sideways change.
float slant_cost(const CurvePiece& piece, const PieceLabel& label, float w) {
  const float slope = label.q.head<2>().dot(piece.tangent) / w;
  return std::log1p(slope * slope);
}

/// Labels of one piece at a crossing, ordered by inverse depth.
class DepthOrder {
 public:
  explicit DepthOrder(const std::vector<PieceLabel>& labels) {
    for (std::size_t i = 0; i < labels.size(); ++i) entries_.emplace_back(0.F, i);
    for (const PieceLabel& label : labels) {
      largest_per_px_ = std::max(largest_per_px_, label.inverse_depth_per_px);
      smallest_per_px_ = std::min(smallest_per_px_, label.inverse_depth_per_px);
    }
  }

  /// Goes to a crossing; the next one of a piece lies near, and has nearly the same order.
  void go_to(const std::vector<PieceLabel>& labels, const Eigen::Vector3f& ray) {
    for (auto& [w, i] : entries_) w = labels[i].q.dot(ray);
    if (!is_ordered_) std::sort(entries_.begin(), entries_.end());
    is_ordered_ = true;
    for (std::size_t k = 1; k < entries_.size(); ++k) {
      const Entry entry = entries_[k];
      std::size_t at = k;
      for (; at > 0 && entry < entries_[at - 1]; --at) entries_[at] = entries_[at - 1];
      entries_[at] = entry;
    }
  }

  using Entry = std::pair<float, std::size_t>;  ///< inverse depth, label
  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }
  [[nodiscard]] float largest_per_px() const { return largest_per_px_; }
  [[nodiscard]] float smallest_per_px() const { return smallest_per_px_; }

 private:
  std::vector<Entry> entries_;
  bool is_ordered_ = false;
  float largest_per_px_ = 0;
  float smallest_per_px_ = std::numeric_limits<float>::max();
};

/// What the crossings say of each label of each piece, every other piece free to choose.
std::vector<std::vector<float>> crossing_support(const LabelledPieces& pieces,
                                                 const JointOptions& options) {
  constexpr float kReach = 4;  // standard deviations
  std::vector<std::vector<float>> support;
  for (const auto& labels : pieces.labels) support.emplace_back(labels.size(), 0.F);
  const CrossingCost crossing_cost(pieces, options);
  std::vector<DepthOrder> orders(pieces.labels.begin(), pieces.labels.end());
  std::vector<float> best_a;
  std::vector<float> best_b;
  for (const PieceCrossing& x : pieces.graph.crossings) {
    const auto& a = pieces.labels[static_cast<std::size_t>(x.a)];
    const auto& b = pieces.labels[static_cast<std::size_t>(x.b)];
    DepthOrder& order_a = orders[static_cast<std::size_t>(x.a)];
    DepthOrder& order_b = orders[static_cast<std::size_t>(x.b)];
    const Eigen::Vector3f ray = x.position.homogeneous();
    order_a.go_to(a, ray);
    order_b.go_to(b, ray);
    best_a.assign(a.size(), 0.F);
    best_b.assign(b.size(), 0.F);
    const auto projection = kReach * static_cast<float>(options.projection_sigma_px);
    const float window =
        projection * std::hypot(order_a.largest_per_px(), order_b.largest_per_px());
    const float lowest = crossing_cost.lowest(order_a.smallest_per_px(), order_b.smallest_per_px());
    const auto& entries = order_b.entries();
    std::size_t first = 0;
    for (const auto& [w, i] : order_a.entries()) {
      while (first < entries.size() && entries[first].first < w - window) ++first;
      for (std::size_t k = first; k < entries.size() && entries[k].first <= w + window; ++k) {
        const std::size_t j = entries[k].second;
        if (lowest + b[j].cost >= best_a[i] && lowest + a[i].cost >= best_b[j]) continue;
        const float cost = crossing_cost(a[i], b[j], x);
        best_a[i] = std::min(best_a[i], cost + b[j].cost);
        best_b[j] = std::min(best_b[j], cost + a[i].cost);
      }
    }
    for (std::size_t i = 0; i < a.size(); ++i)
      support[static_cast<std::size_t>(x.a)][i] += best_a[i];
    for (std::size_t j = 0; j < b.size(); ++j)
      support[static_cast<std::size_t>(x.b)][j] += best_b[j];
  }
  return support;
}

/// out(label) = min(score of the same label in the piece before, its best + change), both lists
/// ordered by (projector, pattern, line); minimum 0.
std::vector<float> passed_on(const std::vector<PieceLabel>& from, const std::vector<float>& score,
                             const std::vector<PieceLabel>& to, float change) {
  std::vector<float> out(to.size(), change);
  if (from.empty()) return std::vector<float>(to.size(), 0.F);
  const float best = *std::min_element(score.begin(), score.end());
  std::size_t i = 0;
  for (std::size_t j = 0; j < to.size(); ++j) {
    while (i < from.size() && from[i].of() < to[j].of()) ++i;
    if (i < from.size() && from[i].of() == to[j].of()) out[j] = std::min(change, score[i] - best);
  }
  return out;
}

/// Adds what the other pieces of its curve say to each label: exact min-marginals of the chain.
std::vector<std::vector<float>> along_curves(const LabelledPieces& pieces,
                                             const std::vector<std::vector<float>>& own,
                                             const JointOptions& options) {
  const auto change = static_cast<float>(options.change_cost);
  std::vector<std::vector<float>> forward = own;
  std::vector<std::vector<float>> backward = own;
  const auto pass = [&](std::vector<std::vector<float>>& scores, int from, int to) {
    const auto f = static_cast<std::size_t>(from);
    const auto t = static_cast<std::size_t>(to);
    const auto add = passed_on(pieces.labels[f], scores[f], pieces.labels[t], change);
    for (std::size_t k = 0; k < add.size(); ++k) scores[t][k] += add[k];
  };
  const auto& chain = pieces.graph.continuations;  // ordered along each curve
  for (std::size_t i = 0; i < chain.size(); ++i) pass(forward, chain[i].first, chain[i].second);
  for (std::size_t i = chain.size(); i-- > 0;) pass(backward, chain[i].second, chain[i].first);
  for (std::size_t p = 0; p < own.size(); ++p) {
    for (std::size_t k = 0; k < own[p].size(); ++k) forward[p][k] += backward[p][k] - own[p][k];
  }
  return forward;
}

/// How many labels of a piece go on. `lacks_crossings`: those of all pieces of its camera.
std::size_t kept_labels(const std::vector<PieceLabel>& labels, bool is_crossed,
                        bool lacks_crossings, const JointOptions& options) {
  const auto most = static_cast<std::size_t>(options.max_labels);
  // Where nothing crosses, nothing tells them apart yet.
  if (lacks_crossings) return 6 * most;
  if (!is_crossed) return 3 * most;
  // The more patterns share a colour, the more of their lines meet at some depth by chance.
  constexpr std::size_t kFewPatterns = 3;
  std::size_t patterns = 0;
  for (std::size_t k = 0; k < labels.size(); ++k)
    patterns += k == 0 || !(labels[k].pattern == labels[k - 1].pattern);
  return patterns <= kFewPatterns ? most : (1 + patterns - kFewPatterns) * most;
}

void keep_supported(LabelledPieces& pieces, const JointOptions& options) {
  auto scores = crossing_support(pieces, options);
  for (std::size_t p = 0; p < scores.size(); ++p) {
    for (std::size_t k = 0; k < scores[p].size(); ++k) scores[p][k] += pieces.labels[p][k].cost;
  }
  scores = along_curves(pieces, scores, options);
  const std::vector<char> is_crossed = pieces_of_crossed_curves(pieces.graph);
  const bool lacks = lacks_crossings(pieces.graph);
  const float behind = largest_gap(pieces.graph, options);
  pieces.scores.resize(scores.size());
  for (std::size_t p = 0; p < pieces.labels.size(); ++p) {
    auto& labels = pieces.labels[p];
    const std::size_t most = kept_labels(labels, is_crossed[p] != 0, lacks, options);
    std::vector<PieceLabel> kept;
    for (const std::size_t i : labels_worth_keeping(scores[p], most, behind)) {
      kept.push_back(labels[i]);
      pieces.scores[p].push_back(scores[p][i]);
    }
    labels = std::move(kept);
  }
}

/// The lines of a pattern in a camera.
struct VisiblePattern {
  VisiblePattern(const Rig& rig, const Camera& camera, const ColorFamily& family,
                 PatternRef pattern, float cost_of_any)
      : ref(pattern), sheets(rig, camera, pattern), cost(cost_of_any) {
    const LinePattern& lines = rig.pattern(ref);
    const std::vector<int> color_of_symbol = family.color_of_symbol(lines);
    for (const int symbol : lines.sequence)
      colors.push_back(static_cast<std::size_t>(color_of_symbol[static_cast<std::size_t>(symbol)]));
  }
  /// Index in the family's colours.
  [[nodiscard]] std::size_t color(int line) const {
    return colors[static_cast<std::size_t>(line) % colors.size()];
  }

  PatternRef ref;
  LineSheets sheets;
  float cost;                       ///< of any of its lines, before the picture says anything
  std::vector<std::size_t> colors;  ///< of one period
};

/// The picture's pixel in the middle of a piece.
Vec2 middle_pixel(const GridGraph& graph, const CurvePiece& piece) {
  const Curve& curve = graph.curves[static_cast<std::size_t>(piece.curve)];
  const auto middle = static_cast<std::size_t>((piece.begin + piece.end) / 2);
  return curve.points[middle].position.cast<double>();
}

/// Of each piece, whether the ray through its middle meets the volume.
std::vector<char> meets_volume(const Camera& camera, const Sphere& volume, const GridGraph& graph,
                               const PieceGraph& pieces) {
  std::vector<char> meets;
  for (const CurvePiece& piece : pieces.pieces)
    meets.push_back(depth_range(camera, volume, middle_pixel(graph, piece)) ? 1 : 0);
  return meets;
}

/// True where a good part of the curves misses the volume, or lies at the picture's border, where
/// an object that is in the picture ends and a room goes on: there is a room around the object.
bool shows_room(const Camera& camera, const GridGraph& graph, const LabelledPieces& pieces) {
  // Of the pieces; rims of an object that fills the volume stay below. In a picture full of lines
  // 1 - (1 - 2 / 20)^2 = 19 % of them lie at the border.
  constexpr double kRoom = 0.1;
  constexpr double kBorder = 0.05;  // of the picture's width and height
  std::size_t outside = 0;
  for (std::size_t p = 0; p < pieces.meets_volume.size(); ++p) {
    const Vec2 pixel = middle_pixel(graph, pieces.graph.pieces[p]);
    const Vec2 share(pixel.x() / camera.width - 0.5, pixel.y() / camera.height - 0.5);
    const bool is_at_border = share.cwiseAbs().maxCoeff() > 0.5 - kBorder;
    outside += pieces.meets_volume[p] == 0 || is_at_border ? 1 : 0;
  }
  return static_cast<double>(outside) > kRoom * static_cast<double>(pieces.meets_volume.size());
}

/// Where along a camera's rays lines may lie: in the volume, and where the camera shows a room,
/// from a radius before the volume to any depth behind it. A wall's line that had no label of its
/// own would take that of a place in the air before it. Panels end, so that a ray meets few more
/// lines from there to infinity.
class LabelReach {
 public:
  LabelReach(const Camera& camera, const Sphere& volume, bool is_room)
      : camera_(camera), volume_(volume), is_room_(is_room) {
    constexpr double kBefore = 2;      // radii from the centre
    constexpr double kFarthest = 1e3;  // of the centre's depth; lines there are those of infinity
    const double distance = (camera.device_from_world * volume.center).z();
    const double before = is_room ? kBefore * volume.radius : volume.radius;
    const double far = is_room ? kFarthest * distance : distance + volume.radius;
    all_ = {std::max(distance / kFarthest, distance - before), far};
  }

  /// Of the ray of a pixel; nothing where no line may lie on it.
  [[nodiscard]] std::optional<DepthRange> along(const Vec2& pixel) const {
    return is_room_ ? all_ : depth_range(camera_, volume_, pixel);
  }
  /// Of all rays.
  [[nodiscard]] double inverse_depth_range() const { return 1 / all_.near - 1 / all_.far; }

 private:
  const Camera& camera_;
  const Sphere& volume_;
  bool is_room_;
  DepthRange all_;
};

}  // namespace

float largest_gap(const PieceGraph& graph, const JointOptions& options) {
  return lacks_crossings(graph) ? std::numeric_limits<float>::max()
                                : static_cast<float>(options.max_behind);
}

std::vector<std::size_t> labels_worth_keeping(std::span<const float> costs, std::size_t most,
                                              float behind) {
  if (costs.empty()) return {};
  const float limit = *std::min_element(costs.begin(), costs.end()) + behind;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    if (costs[i] <= limit) order.push_back(i);
  }
  if (order.size() > most) {
    std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(most), order.end(),
                     [&](std::size_t i, std::size_t j) {
                       return costs[i] != costs[j] ? costs[i] < costs[j] : i < j;
                     });
    order.resize(most);
    std::sort(order.begin(), order.end());
  }
  return order;
}

CrossingCost::CrossingCost(const LabelledPieces& pieces, const JointOptions& options)
    : lights_(pieces.lights),
      wrong_(static_cast<float>(options.crossing_outliers)),
      disagreement_(options.disagreement_cost()),
      projection2_(static_cast<float>(options.projection_sigma_px * options.projection_sigma_px)),
      density_((1 - wrong_) * pieces.inverse_depth_range /
               std::sqrt(2 * std::numbers::pi_v<float>)) {}

// A curve is where the surface meets its light sheet q. So along its tangent t the inverse depth w
// of the surface changes as that of the sheet: g . t = q_xy . t, g being the gradient of w. Two
// curves give g, and with it the tangent plane {X : s . X = 1}, s = (g, w - g . p). The camera lies
// at s . X = 0: so it sees the side where s . X < 1, and a projector at c lights that side where
// s . c < 1.
float CrossingCost::lit_share(const PieceLabel& a, const PieceLabel& b,
                              const PieceCrossing& crossing) const {
  const auto square_to = [](const Eigen::Vector2f& t) { return Eigen::Vector2f(-t.y(), t.x()); };
  const Eigen::Vector2f& ta = crossing.along_a.tangent;
  const Eigen::Vector2f& tb = crossing.along_b.tangent;
  constexpr float kLeastSine = 0.05F;  // 3 degrees
  const float sine = ta.x() * tb.y() - ta.y() * tb.x();
  if (std::abs(sine) < kLeastSine) return 1;  // nearly the same direction: g is open
  const Eigen::Vector2f qa = a.q.head<2>();
  const Eigen::Vector2f qb = b.q.head<2>();
  const Eigen::Vector2f na = square_to(ta) / sine;
  const Eigen::Vector2f nb = square_to(tb) / sine;
  const Eigen::Vector2f g = qb.dot(tb) * na - qa.dot(ta) * nb;
  const Eigen::Vector2f& p = crossing.position;
  const float w = 0.5F * (a.q + b.q).dot(p.homogeneous());
  // A tangent that is off by an angle moves g . t by the angle times what g and q differ across t.
  const float error_a = crossing.along_a.sigma * (g - qa).norm();
  const float error_b = crossing.along_b.sigma * (g - qb).norm();
  float share = 1;
  for (const int projector : {a.pattern.projector, b.pattern.projector}) {
    const Eigen::Vector3f& c = lights_[static_cast<std::size_t>(projector)];
    const Eigen::Vector2f lever = c.head<2>() - c.z() * p;
    const float margin = 1 - w * c.z() - g.dot(lever);
    const float of_a = error_a * nb.dot(lever);
    const float of_b = error_b * na.dot(lever);
    const float sigma = std::sqrt(of_a * of_a + of_b * of_b);
    if (margin > 4 * sigma) continue;
    if (margin < -6 * sigma) return 0;
    share *= 0.5F * std::erfc(-margin / (std::numbers::sqrt2_v<float> * sigma));
  }
  return share;
}

LabelledPieces possible_labels(const Rig& rig, const std::vector<ColorFamily>& families,
                               const GridGraph& graph, const JointOptions& options) {
  const Camera& camera = rig.camera(graph.camera);
  const Sphere volume = working_volume(rig);
  LabelledPieces result;
  result.graph = cut_into_pieces(camera, graph, options.piece_length,
                                 pixels_at_center(rig, camera, line_spacing(rig)));
  std::vector<std::vector<VisiblePattern>> visible(families.size());
  for (std::size_t f = 0; f < families.size(); ++f) {
    const std::vector<float> costs = phase_costs(rig, camera, families[f]);
    for (std::size_t k = 0; k < costs.size(); ++k) {
      const PatternRef& ref = families[f].patterns[k];
      if (!can_see_pattern(rig, camera, ref.projector)) continue;
      visible[f].emplace_back(rig, camera, families[f], ref, costs[k]);
    }
  }
  result.meets_volume = meets_volume(camera, volume, graph, result.graph);
  result.shows_room = shows_room(camera, graph, result);
  const LabelReach reach(camera, volume, result.shows_room);
  result.inverse_depth_range = static_cast<float>(reach.inverse_depth_range());
  for (const Projector& projector : rig.projectors) {
    const Vec3 light = camera.device_from_world * projector.center();
    result.lights.push_back(light.cast<float>());
  }
  const FloorCost floor_cost(rig, camera, result.inverse_depth_range, options);
  std::vector<int> lines;
  std::vector<PieceLabel> labels;
  result.labels.resize(result.graph.pieces.size());
  for (std::size_t p = 0; p < result.graph.pieces.size(); ++p) {
    const CurvePiece& piece = result.graph.pieces[p];
    labels.clear();
    const Curve& curve = graph.curves[static_cast<std::size_t>(piece.curve)];
    const auto range = reach.along(middle_pixel(graph, piece));
    if (!range) continue;
    const auto w_low = static_cast<float>(1 / range->far);
    const auto w_high = static_cast<float>(1 / range->near);
    const ColorFamily& family = families[static_cast<std::size_t>(curve.family)];
    const std::vector<float> colors = color_costs(curve, piece, family.colors.size(), options);
    for (const VisiblePattern& pattern : visible[static_cast<std::size_t>(curve.family)]) {
      pattern.sheets.candidates(piece.middle, w_low, w_high, lines);
      for (const int line : lines) {
        LineSheets::Sheet sheet;
        if (!pattern.sheets.find(line, piece.middle, w_low, w_high, sheet)) continue;
        PieceLabel label{pattern.ref, line, sheet.q, sheet.inverse_depth_per_px, 0};
        const float w = sheet.q.dot(piece.middle.homogeneous());
        label.cost = pattern.cost + colors[pattern.color(line)] + slant_cost(piece, label, w) +
                     floor_cost(label, piece.middle.homogeneous());
        labels.push_back(label);
      }
    }
    result.labels[p] = labels;
  }
  keep_supported(result, options);
  return result;
}

}  // namespace pencilscan
