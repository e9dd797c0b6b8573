#include "pencilscan/solution/piece_labels.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace pencilscan {
namespace {

/// Cost of each colour of the family, the best 0.
std::vector<float> color_costs(const Curve& curve, const CurvePiece& piece, std::size_t colors,
                               const JointOptions& options) {
  constexpr float kPointsPerMeasurement = 9;  // neighbours share one colour measurement
  std::vector<float> evidence(colors, 0.F);
  for (int i = piece.begin; i < piece.end; ++i) {
    for (std::size_t c = 0; c < colors; ++c) {
      evidence[c] +=
          curve.code[static_cast<std::size_t>(i) * colors + c] / kPointsPerMeasurement;
    }
  }
  const float best = *std::max_element(evidence.begin(), evidence.end());
  for (float& e : evidence)
    e = std::min(best - e, static_cast<float>(options.max_color_cost));
  return evidence;
}

/// How the surface would run along the piece: depth change per sideways change.
float slant_cost(const CurvePiece& piece, const PieceLabel& label, float w) {
  const float slope = label.q.head<2>().dot(piece.tangent) / w;
  return std::log1p(slope * slope);
}

float agreement_window(const PieceLabel& a, const PieceLabel& b, const JointOptions& options) {
  return 4 * static_cast<float>(options.projection_sigma_px) *
         std::hypot(a.inverse_depth_per_px, b.inverse_depth_per_px);
}

/// What the crossings say of each label of each piece, every other piece free to choose.
std::vector<std::vector<float>> crossing_support(const LabelledPieces& pieces,
                                                 const JointOptions& options) {
  std::vector<std::vector<float>> support;
  for (const auto& labels : pieces.labels) support.emplace_back(labels.size(), 0.F);
  std::vector<float> w_a;
  std::vector<float> w_b;
  std::vector<float> best_a;
  std::vector<float> best_b;
  for (const PieceCrossing& x : pieces.graph.crossings) {
    const auto& a = pieces.labels[static_cast<std::size_t>(x.a)];
    const auto& b = pieces.labels[static_cast<std::size_t>(x.b)];
    const Eigen::Vector3f ray = x.position.homogeneous();
    const auto depths = [&](const std::vector<PieceLabel>& labels, std::vector<float>& w) {
      w.clear();
      for (const PieceLabel& label : labels) w.push_back(label.q.dot(ray));
    };
    depths(a, w_a);
    depths(b, w_b);
    best_a.assign(a.size(), 0.F);
    best_b.assign(b.size(), 0.F);
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = 0; j < b.size(); ++j) {
        if (std::abs(w_a[i] - w_b[j]) > agreement_window(a[i], b[j], options)) continue;
        const float cost = crossing_cost(a[i], b[j], x, pieces.inverse_depth_range, options);
        best_a[i] = std::min(best_a[i], cost + b[j].cost);
        best_b[j] = std::min(best_b[j], cost + a[i].cost);
      }
    }
    for (std::size_t i = 0; i < a.size(); ++i) support[static_cast<std::size_t>(x.a)][i] += best_a[i];
    for (std::size_t j = 0; j < b.size(); ++j) support[static_cast<std::size_t>(x.b)][j] += best_b[j];
  }
  return support;
}

void keep_supported(LabelledPieces& pieces, const JointOptions& options) {
  const auto support = crossing_support(pieces, options);
  for (std::size_t p = 0; p < pieces.labels.size(); ++p) {
    auto& labels = pieces.labels[p];
    std::vector<std::size_t> order(labels.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const std::size_t count =
        std::min(labels.size(), static_cast<std::size_t>(options.max_labels));
    const auto score = [&](std::size_t i) { return labels[i].cost + support[p][i]; };
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count),
                      order.end(), [&](std::size_t i, std::size_t j) {
                        return score(i) != score(j) ? score(i) < score(j) : i < j;
                      });
    order.resize(count);
    std::sort(order.begin(), order.end());
    std::vector<PieceLabel> kept;
    for (const std::size_t i : order) kept.push_back(labels[i]);
    labels = std::move(kept);
  }
}

}  // namespace

float crossing_cost(const PieceLabel& a, const PieceLabel& b, const PieceCrossing& crossing,
                    float inverse_depth_range, const JointOptions& options) {
  const auto wrong = static_cast<float>(options.crossing_outliers);
  if (a.pattern == b.pattern) return -std::log(wrong);  // lines of one pattern do not cross
  const float r = (a.q - b.q).dot(crossing.position.homogeneous());
  const auto projection = static_cast<float>(options.projection_sigma_px);
  const float s2 = projection * projection *
                       (a.inverse_depth_per_px * a.inverse_depth_per_px +
                        b.inverse_depth_per_px * b.inverse_depth_per_px) +
                   crossing.sigma * crossing.sigma * (a.q - b.q).head<2>().squaredNorm();
  const float density = inverse_depth_range / std::sqrt(2 * std::numbers::pi_v<float> * s2);
  return -std::log(wrong + (1 - wrong) * density * std::exp(-0.5F * r * r / s2));
}

LabelledPieces possible_labels(const Rig& rig, const std::vector<ColorFamily>& families,
                               const GridGraph& graph, const JointOptions& options) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(graph.camera)];
  const Sphere volume = working_volume(rig);
  LabelledPieces result;
  result.graph = cut_into_pieces(camera, graph, options.piece_length);
  std::map<std::pair<int, int>, LineSheets> sheets;
  for (const ColorFamily& family : families) {
    for (const PatternRef& ref : family.patterns) {
      if (can_see_pattern(rig, camera, ref.projector))
        sheets.emplace(std::pair(ref.projector, ref.pattern), LineSheets(rig, camera, ref));
    }
  }
  const double distance = (camera.device_from_world * volume.center).z();
  result.inverse_depth_range = static_cast<float>(
      1 / std::max(1e-3 * distance, distance - volume.radius) - 1 / (distance + volume.radius));
  for (const CurvePiece& piece : result.graph.pieces) {
    auto& labels = result.labels.emplace_back();
    const Curve& curve = graph.curves[static_cast<std::size_t>(piece.curve)];
    const auto middle = static_cast<std::size_t>((piece.begin + piece.end) / 2);
    const auto range = depth_range(camera, volume, curve.points[middle].position.cast<double>());
    if (!range) continue;
    const auto w_low = static_cast<float>(1 / range->far);
    const auto w_high = static_cast<float>(1 / range->near);
    const ColorFamily& family = families[static_cast<std::size_t>(curve.family)];
    const std::vector<float> colors = color_costs(curve, piece, family.colors.size(), options);
    for (const PatternRef& ref : family.patterns) {
      const auto it = sheets.find({ref.projector, ref.pattern});
      if (it == sheets.end()) continue;
      const LinePattern& pattern = rig.projectors[static_cast<std::size_t>(ref.projector)]
                                       .patterns[static_cast<std::size_t>(ref.pattern)];
      const std::vector<int> color_of = family.color_of_symbol(pattern);
      for (int line = 0; line < it->second.line_count(); ++line) {
        LineSheets::Sheet sheet;
        if (!it->second.find(line, piece.middle, w_low, w_high, sheet)) continue;
        PieceLabel label{ref, line, sheet.q, sheet.inverse_depth_per_px, 0};
        const float w = sheet.q.dot(piece.middle.homogeneous());
        label.cost = colors[static_cast<std::size_t>(
                         color_of[static_cast<std::size_t>(pattern.symbol(line))])] +
                     slant_cost(piece, label, w);
        labels.push_back(label);
      }
    }
  }
  keep_supported(result, options);
  return result;
}

}  // namespace pencilscan
