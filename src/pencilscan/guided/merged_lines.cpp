#include "pencilscan/guided/merged_lines.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <set>

#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/detection/refine.h"

namespace pencilscan {
namespace {

using Eigen::Index;
using Eigen::MatrixXf;
using Eigen::Vector2f;
using Eigen::VectorXf;

constexpr int kLeastPoints = 4;  // of a stretch of a curve, as of one that is found anew

/// Of lines that cross at more than this, 37 degrees, a curve of one leaves the other alone soon.
constexpr float kSideBySide = 0.8F;  // cosine

/// Height of the profile of a line, `across` px from its middle.
float height(float across, float width) {
  float value = 0;
  if (std::abs(across) < kModelReach * width) add_line_profile(1, width, across, 1, 1, &value, 1);
  return value;
}

std::size_t nearest_to(const Vector2f& place, const std::vector<CurvePoint>& points) {
  const auto apart2 = [&](const CurvePoint& p) { return (p.position - place).squaredNorm(); };
  const auto nearest = std::min_element(
      points.begin(), points.end(),
      [&](const CurvePoint& a, const CurvePoint& b) { return apart2(a) < apart2(b); });
  return static_cast<std::size_t>(nearest - points.begin());
}

Curve moved(Curve curve, const Vector2f& by) {
  for (CurvePoint& p : curve.points) p.position += by;
  return curve;
}

/// What the samples across a point of a line say of the amplitudes of it (first), of a level
/// (second) and of the lines beside it.
struct Equations {
  MatrixXf normal;
  VectorXf right;

  explicit Equations(Index columns)
      : normal(MatrixXf::Zero(columns, columns)), right(VectorXf::Zero(columns)) {}
};

Equations equations_at(const cv::Mat& light, const CurvePoint& p,
                       const std::vector<const Curve*>& beside) {
  constexpr float kAlong = 2;  // px, by which a curve may end before
  std::vector<const CurvePoint*> nearest;
  for (const Curve* curve : beside) {
    const CurvePoint& q = curve->points[nearest_to(p.position, curve->points)];
    nearest.push_back(std::abs(q.tangent().dot(p.position - q.position)) < kAlong ? &q : nullptr);
  }
  Equations result(static_cast<Index>(beside.size()) + 2);
  VectorXf row(result.right.size());
  for (int o = -kMaxHalf; o <= kMaxHalf; ++o) {
    const Vector2f at = p.position + static_cast<float>(o) * p.normal;
    row.setZero();
    row[0] = height(static_cast<float>(o), p.width_px);
    row[1] = 1;
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      if (nearest[k] == nullptr) continue;
      row[static_cast<Index>(k) + 2] =
          height(nearest[k]->normal.dot(at - nearest[k]->position), nearest[k]->width_px);
    }
    result.normal += row * row.transpose();
    result.right += sample_bilinear(light, at.x(), at.y()) * row;
  }
  return result;
}

/// Amplitudes of all lines along `line`, each from the profiles around it, in the order of
/// Equations.
std::vector<VectorXf> amplitudes_along(const cv::Mat& light, const Curve& line,
                                       const std::vector<const Curve*>& beside) {
  constexpr float kHeld = 1e-3F;  // share of a level's information, of lines that no sample shows
  std::vector<Equations> equations;
  for (const CurvePoint& p : line.points) equations.push_back(equations_at(light, p, beside));
  const int half_arc = RefineOptions{}.half_arc;
  const auto count = static_cast<int>(equations.size());
  std::vector<VectorXf> amplitudes;
  for (int i = 0; i < count; ++i) {
    Equations sum(static_cast<Index>(beside.size()) + 2);
    for (int j = std::max(0, i - half_arc); j < std::min(count, i + half_arc + 1); ++j) {
      sum.normal += equations[static_cast<std::size_t>(j)].normal;
      sum.right += equations[static_cast<std::size_t>(j)].right;
    }
    sum.normal.diagonal().array() += kHeld * sum.normal(1, 1);
    amplitudes.push_back(sum.normal.ldlt().solve(sum.right));
  }
  return amplitudes;
}

}  // namespace

MergedLines::MergedLines(const Camera& camera, std::span<const Curve> curves,
                         std::span<const LabeledRun> runs, const std::vector<char>& subtracted,
                         std::span<const PredictedPoint> predicted,
                         std::span<const cv::Mat> unexplained)
    : curves_(curves),
      runs_(runs),
      unexplained_(unexplained),
      named_(places_of_runs(camera, curves, runs, subtracted)),
      predicted_(camera.width, camera.height, 3) {
  for (const PredictedPoint& p : predicted) predicted_.add(p.position, p);
}

/// The predicted point of a line next to a point of its curve; nullptr: there is none.
const PredictedPoint* MergedLines::expected_at(const CurvePoint& p, const LineName& name) const {
  constexpr float kReach = 2.5F;  // px; predicted points of a line lie a row apart
  const PredictedPoint* nearest = nullptr;
  float best = kReach * kReach;
  predicted_.around(p.position, kReach, [&](const PredictedPoint& q) {
    const float apart2 = (q.position - p.position).squaredNorm();
    if (apart2 >= best || name_of(q) != name) return;
    best = apart2;
    nearest = &q;
  });
  return nearest;
}

std::vector<MergedLines::Neighbour> MergedLines::neighbours_of(const Curve& guess,
                                                               const LineName& name, float reach,
                                                               std::size_t& beside) const {
  std::set<std::pair<std::size_t, int>> points;  // of runs and their curves, in order
  for (const CurvePoint& g : guess.points) {
    bool any = false;
    named_.around(g.position, reach, [&](const RunPoint& n) {
      const LabeledRun& run = runs_[n.run];
      const Curve& curve = curves_[static_cast<std::size_t>(run.curve)];
      const CurvePoint& p = curve.points[static_cast<std::size_t>(n.point)];
      if (curve.family != guess.family || LineName{run.label.pattern, run.label.line} == name ||
          (p.position - g.position).squaredNorm() > reach * reach ||
          std::abs(p.normal.dot(g.normal)) < kSideBySide)
        return;
      points.insert({n.run, n.point});
      any = true;
    });
    beside += any ? 1 : 0;
  }
  std::vector<Neighbour> neighbours;
  std::pair<std::size_t, int> last{runs_.size(), 0};
  for (const auto& at : points) {
    const LabeledRun& run = runs_[at.first];
    const Curve& curve = curves_[static_cast<std::size_t>(run.curve)];
    const CurvePoint& p = curve.points[static_cast<std::size_t>(at.second)];
    const PredictedPoint* expected = expected_at(p, {run.label.pattern, run.label.line});
    if (expected == nullptr) continue;
    if (at != std::pair(last.first, last.second + 1)) neighbours.emplace_back();
    last = at;
    neighbours.back().fitted.points.push_back(p);
    CurvePoint& q = neighbours.back().expected.points.emplace_back(p);
    q.position += p.normal.dot(expected->position - p.position) * p.normal;
    q.width_px = std::min(p.width_px, guess.points.front().width_px);
  }
  std::erase_if(neighbours, [](const Neighbour& n) {
    return n.fitted.points.size() < static_cast<std::size_t>(kLeastPoints);
  });
  return neighbours;
}

MergedLines::Fit MergedLines::fit(const Curve& guess, const LineName& name) const {
  Fit result;
  Eigen::AlignedBox2f box;
  float widest = 0;
  for (const CurvePoint& p : guess.points) {
    box.extend(p.position);
    widest = std::max(widest, p.width_px);
  }
  if (widest > kMaxLineWidth) return result;  // no profile at full size holds two of these
  const float reach = kModelReach * widest;
  std::vector<Neighbour> neighbours = neighbours_of(guess, name, reach, result.beside);
  if (neighbours.empty()) return result;

  const cv::Mat& image = unexplained_[static_cast<std::size_t>(guess.family)];
  const auto margin = static_cast<int>(reach) + kMaxHalf + 2;
  const cv::Point from(std::max(0, static_cast<int>(box.min().x()) - margin),
                       std::max(0, static_cast<int>(box.min().y()) - margin));
  const cv::Point to(std::min(image.cols, static_cast<int>(box.max().x()) + margin + 1),
                     std::min(image.rows, static_cast<int>(box.max().y()) + margin + 1));
  cv::Mat light = image(cv::Rect(from, to)).clone();
  const Vector2f corner(static_cast<float>(from.x), static_cast<float>(from.y));
  Curve line = moved(guess, -corner);
  std::vector<const Curve*> expected;
  for (Neighbour& n : neighbours) {
    n.expected = moved(std::move(n.expected), -corner);
    expected.push_back(&n.expected);
    add_curve(moved(std::move(n.fitted), -corner), light);
  }
  const std::vector<VectorXf> amplitudes = amplitudes_along(light, line, expected);
  for (std::size_t k = 0; k < neighbours.size(); ++k) {
    for (CurvePoint& q : neighbours[k].expected.points) {
      const VectorXf& there = amplitudes[nearest_to(q.position, line.points)];
      q.amplitude = std::max(0.F, there[static_cast<Index>(k) + 2]);
    }
    subtract_curve(neighbours[k].expected, light);
  }
  RefineOptions fitting;
  fitting.min_points = kLeastPoints;
  std::vector<Curve> pieces = fit_guess(light, line, fitting);
  if (pieces.empty()) return result;
  // The curve pulled the surface, too: its line is not quite where it is expected.
  for (const Curve& piece : pieces) subtract_curve(piece, light);
  for (const Neighbour& n : neighbours) {
    add_curve(n.expected, light);
    std::vector<Curve> again = fit_guess(light, n.expected, fitting);
    if (again.empty()) again.push_back(n.expected);
    for (const Curve& piece : again) subtract_curve(piece, light);
  }
  for (const Curve& piece : pieces) add_curve(piece, light);
  for (Curve& piece : fit_guess(light, std::move(line), fitting))
    result.pieces.push_back(moved(std::move(piece), corner));
  return result;
}

}  // namespace pencilscan
