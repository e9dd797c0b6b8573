#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <vector>

#include "pencilscan/joint/curve_pieces.h"
#include "pencilscan/joint/joint_options.h"
#include "pencilscan/joint/line_sheets.h"
#include "pencilscan/labeling/labeling.h"

namespace pencilscan {

/// A line of a pattern; ordered by pattern.
struct PatternLine {
  PatternRef pattern;
  int line = 0;

  friend bool operator==(const PatternLine&, const PatternLine&) = default;
  friend bool operator<(const PatternLine& a, const PatternLine& b) {
    return std::tie(a.pattern.projector, a.pattern.pattern, a.line) <
           std::tie(b.pattern.projector, b.pattern.pattern, b.line);
  }
};

/// A line that a piece may show.
struct PieceLabel {
  PatternRef pattern;
  int line = 0;
  Eigen::Vector3f q = Eigen::Vector3f::Zero();  ///< inverse depth = q . (x, y, 1)
  float inverse_depth_per_px = 0;               ///< per projector px across the line
  float cost = 0;                               ///< negative log-likelihood without other pieces

  [[nodiscard]] PatternLine of() const { return {pattern, line}; }
  /// Where it puts what the camera sees at normalised (x, y), in the camera's frame.
  [[nodiscard]] Vec3 place(const Eigen::Vector2f& at) const {
    const Eigen::Vector3f ray = at.homogeneous();
    return (ray / q.dot(ray)).cast<double>();
  }
};

/// The pieces of one camera with their possible labels.
struct LabelledPieces {
  PieceGraph graph;
  std::vector<std::vector<PieceLabel>> labels;  ///< per piece, without "outlier"
  /// Of each label: its cost with what crossings and the curve's other pieces say, each of them
  /// free to choose.
  std::vector<std::vector<float>> scores;
  std::vector<char> meets_volume;       ///< per piece, whether the ray through its middle does
  bool shows_room = false;              ///< the camera does, around the object
  float inverse_depth_range = 1;        ///< of where labels are sought
  std::vector<Eigen::Vector3f> lights;  ///< per projector: its centre in the camera's frame
};

/// How much more than the best of its piece a label of a camera may cost before it is left out.
/// Where nothing crosses, costs say next to nothing so far, and all stay.
[[nodiscard]] float largest_gap(const PieceGraph& graph, const JointOptions& options);

/// Which labels of a piece go on, by their cost: at most `most`, and none that costs `behind` more
/// than the best. Ascending.
[[nodiscard]] std::vector<std::size_t> labels_worth_keeping(std::span<const float> costs,
                                                            std::size_t most, float behind);

/// Probability of each label of each piece of one camera; what is missing to 1 is "no line".
using PieceBeliefs = std::vector<std::vector<float>>;

/// The labels that a piece may have. First these are all lines of its family whose depth lies in
/// the volume, or also behind it where the camera shows a room. Each has the cost of the piece's
/// colours, of the slant that the line would give the surface and of its depth beside a stated
/// floor. Then only those that the crossings support best are kept (options.max_labels).
[[nodiscard]] LabelledPieces possible_labels(const Rig& rig,
                                             const std::vector<ColorFamily>& families,
                                             const GridGraph& graph, const JointOptions& options);

/// The crossing term: cost of the labels of two pieces that cross. Each label gives the crossing a
/// depth; the depths of the true labels agree, and the surface through both curves faces both
/// projectors. The cost is the negative logarithm of the likelihood ratio to random depths. Keeps
/// a reference to `pieces`.
class CrossingCost {
 public:
  CrossingCost(const LabelledPieces& pieces, const JointOptions& options);

  [[nodiscard]] float operator()(const PieceLabel& a, const PieceLabel& b,
                                 const PieceCrossing& crossing) const {
    constexpr float kFarthest2 = 36;  // squared standard deviations; beyond, nothing is left
    if (a.pattern == b.pattern) return disagreement_;  // lines of one pattern do not cross
    const Eigen::Vector3f q = a.q - b.q;
    const float r = q.dot(crossing.position.homogeneous());
    const float s2 = projection2_ * (a.inverse_depth_per_px * a.inverse_depth_per_px +
                                     b.inverse_depth_per_px * b.inverse_depth_per_px) +
                     crossing.sigma * crossing.sigma * q.head<2>().squaredNorm();
    if (r * r > kFarthest2 * s2) return disagreement_;
    const float right = density_ / std::sqrt(s2) * std::exp(-0.5F * r * r / s2);
    return -std::log(wrong_ + right * lit_share(a, b, crossing));
  }
  /// No cost of labels with at least these inverse depths per projector px is lower.
  [[nodiscard]] float lowest(float a_per_px, float b_per_px) const {
    const float s2 = projection2_ * (a_per_px * a_per_px + b_per_px * b_per_px);
    return std::min(disagreement_, -std::log(wrong_ + density_ / std::sqrt(s2)));
  }

 private:
  /// Probability that both projectors light the side of the surface that the camera sees.
  [[nodiscard]] float lit_share(const PieceLabel& a, const PieceLabel& b,
                                const PieceCrossing& crossing) const;

  const std::vector<Eigen::Vector3f>& lights_;
  float wrong_;
  float disagreement_;
  float projection2_;  ///< variance, squared projector px
  float density_;      ///< of right depths, at its peak for unit deviation
};

}  // namespace pencilscan
