#include "pencilscan/uncertainty/blur_equations.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kShared = 6;  // unknowns of the baseline that all devices share
constexpr std::size_t kLeastOfPair = 30;
constexpr double kLeastDeviationPx2 = 0.02;  // relief and unmixing: no window is surer than this
constexpr double kHuber = 1.5;               // deviations

/// Cameras or projectors that took part, in order.
std::map<int, Index> places_of(std::span<const LineBlur> lines, int LineBlur::*device) {
  std::map<int, Index> places;
  for (const LineBlur& line : lines) places.emplace(line.*device, 0);
  Index next = 0;
  for (auto& [index, place] : places) place = next++;
  return places;
}

/// J' J, by half of the work that a product takes.
MatrixXd products_of(const MatrixXd& J) {
  MatrixXd result = MatrixXd::Zero(J.cols(), J.cols());
  result.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

}  // namespace

Products products(const Twist& m) {
  Products q;
  int k = 0;
  for (int a = 0; a < kTwist; ++a) {
    for (int b = a; b < kTwist; ++b) q[k++] = m[a] * m[b];
  }
  return q;
}

double median_of(std::span<const LineBlur> lines, double LineBlur::*value) {
  std::vector<double> values;
  for (const LineBlur& line : lines) values.push_back(line.*value);
  return upper_median(std::move(values));
}

BlurColumns::BlurColumns(std::span<const LineBlur> lines)
    : lines_(lines),
      cameras_(places_of(lines, &LineBlur::camera)),
      projectors_(places_of(lines, &LineBlur::projector)),
      spacing_(median_of(lines, &LineBlur::px_per_line)),
      camera_depth_(median_of(lines, &LineBlur::camera_depth)),
      projector_depth_(median_of(lines, &LineBlur::projector_depth)) {
  for (const LineBlur& line : lines) pivot_ += line.point / static_cast<double>(lines.size());
  double square = 0;
  for (const LineBlur& line : lines) square += (line.point - pivot_).squaredNorm();
  reach_ = std::max(std::sqrt(square / static_cast<double>(lines.size())), 1e-9);
  baseline_ = static_cast<Index>(2 * cameras_.size() + 2 * projectors_.size()) + kShared;
}

void BlurColumns::row(std::size_t i, VectorXd& values) const {
  const LineBlur& line = lines_[i];
  values.setZero(count());
  const double spacing = line.px_per_line / spacing_;
  const double spacing2 = spacing * spacing;
  const Index camera = 2 * cameras_.at(line.camera);
  values[camera] = 1;
  values[camera + 1] = (line.camera_depth - camera_depth_) / reach_;
  const auto projector = 2 * (static_cast<Index>(cameras_.size()) + projectors_.at(line.projector));
  values[projector] = spacing2;
  values[projector + 1] = spacing2 * (line.projector_depth - projector_depth_) / reach_;
  const double g2 = line.px_per_length * line.px_per_length;
  values.segment<kShared>(baseline_ - kShared) << 1 / spacing2, 1 / (spacing2 * spacing2), g2,
      line.camera_cosine, line.projector_cosine, std::cos(4 * line.direction);
  Twist g;
  g << line.normal, (line.point - pivot_).cross(line.normal) / reach_;
  Products q = products(line.px_per_length * g);
  int k = 0;
  for (int a = 0; a < kTwist; ++a) {
    for (int b = a; b < kTwist; ++b, ++k) q[k] *= a == b ? 1. / 12 : 2. / 12;
  }
  values.tail<kProducts>() = q;
}

BlurEquations& BlurEquations::operator+=(const BlurEquations& other) {
  S += other.S;
  h += other.h;
  return *this;
}

BlurEquations& BlurEquations::operator-=(const BlurEquations& other) {
  S -= other.S;
  h -= other.h;
  return *this;
}

BlurEquations BlurEquations::without_first(Index n) const {
  const Index rest = h.size() - n;
  MatrixXd A = S.topLeftCorner(n, n);
  A.diagonal().array() += 1e-9 * A.trace() / static_cast<double>(n);
  MatrixXd right(n, rest + 1);
  right << S.topRightCorner(n, rest), h.head(n);
  const MatrixXd solved = A.ldlt().solve(right);
  BlurEquations result(rest);
  result.S = S.bottomRightCorner(rest, rest) - S.bottomLeftCorner(rest, n) * solved.leftCols(rest);
  result.h = h.tail(rest) - S.bottomLeftCorner(rest, n) * solved.col(rest);
  return result;
}

BlurFit::BlurFit(std::span<const LineBlur> lines) : lines_(lines), columns_(lines) {
  rows_.resize(static_cast<Index>(lines.size()), columns_.count());
  root_.resize(static_cast<Index>(lines.size()));
  values_.resize(static_cast<Index>(lines.size()));
  VectorXd row;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto at = static_cast<Index>(i);
    columns_.row(i, row);
    root_[at] = 1 / std::hypot(lines[i].deviation_px2, kLeastDeviationPx2);
    rows_.row(at) = root_[at] * row.transpose();
    values_[at] = root_[at] * lines[i].variance_px2;
  }
  weigh();
  for (std::size_t i = 0; i < lines.size(); ++i) weight_[static_cast<Index>(i)] /= lines[i].overlap;
}

MotionEquations BlurFit::equations() const {
  std::map<std::pair<int, int>, std::vector<Index>> members;
  for (std::size_t i = 0; i < lines_.size(); ++i)
    members[{lines_[i].camera, lines_[i].projector}].push_back(static_cast<Index>(i));
  std::array<std::map<int, BlurEquations>, 3> parts;
  BlurEquations all(columns_.count());
  for (const auto& [pair, rows] : members) {
    if (rows.size() < kLeastOfPair) continue;
    const BlurEquations of_pair = sum(rows);
    const std::array<int, 3> key = {static_cast<int>(parts[0].size()), pair.first, pair.second};
    for (std::size_t kind = 0; kind < parts.size(); ++kind)
      parts[kind].try_emplace(key[kind], columns_.count()).first->second += of_pair;
    all += of_pair;
  }
  const Index baseline = columns_.baseline();
  MotionEquations result = {all.without_first(baseline), parts[0].size(), {}};
  for (std::size_t kind = 0; kind < parts.size(); ++kind) {
    if (parts[kind].size() == 1) continue;
    for (const auto& [key, part] : parts[kind]) {
      BlurEquations rest = all;
      rest -= part;
      result.without[kind].push_back(rest.without_first(baseline));
    }
  }
  return result;
}

std::vector<double> BlurFit::expected(const Twist& m) const {
  const Index n = columns_.baseline();
  const VectorXd of_motion = rows_.rightCols<kProducts>() * products(m);
  const MatrixXd A = rows_.leftCols(n);
  MatrixXd normal = products_of(weight_.cwiseSqrt().asDiagonal() * A);
  normal.diagonal().array() += 1e-9 * normal.trace() / static_cast<double>(n);
  const VectorXd baseline =
      normal.ldlt().solve(A.transpose() * (weight_.cwiseProduct(values_ - of_motion)));
  const VectorXd fitted = A * baseline + of_motion;
  std::vector<double> result(lines_.size());
  for (std::size_t i = 0; i < lines_.size(); ++i)
    result[i] = fitted[static_cast<Index>(i)] / root_[static_cast<Index>(i)];
  return result;
}

void BlurFit::weigh() {
  constexpr int kRounds = 3;
  weight_ = VectorXd::Ones(values_.size());
  for (int round = 0; round < kRounds; ++round) {
    const MatrixXd weighted = weight_.cwiseSqrt().asDiagonal() * rows_;
    MatrixXd A = products_of(weighted);
    A.diagonal() *= 1 + 1e-9;
    A.diagonal().array() += 1e-12 * A.trace();
    const VectorXd x =
        A.ldlt().solve(weighted.transpose() * weight_.cwiseSqrt().cwiseProduct(values_));
    const VectorXd rest = values_ - rows_ * x;
    std::vector<double> sizes(rest.data(), rest.data() + rest.size());
    for (double& size : sizes) size = std::abs(size);
    const double noise = kDeviationPerMedian * upper_median(std::move(sizes));
    if (!(noise > 0)) return;
    for (Index i = 0; i < rest.size(); ++i)
      weight_[i] = 1 / std::max(1.0, std::abs(rest[i]) / (kHuber * noise));
    noise_ = noise;
  }
  weight_ /= noise_ * noise_;
}

BlurEquations BlurFit::sum(const std::vector<Index>& members) const {
  MatrixXd rows(static_cast<Index>(members.size()), rows_.cols());
  VectorXd values(rows.rows());
  VectorXd weight(rows.rows());
  for (std::size_t i = 0; i < members.size(); ++i) {
    const auto at = static_cast<Index>(i);
    rows.row(at) = rows_.row(members[i]);
    values[at] = values_[members[i]];
    weight[at] = weight_[members[i]];
  }
  BlurEquations result(rows.cols());
  rows = weight.cwiseSqrt().asDiagonal() * rows;
  result.S = products_of(rows);
  result.h = rows.transpose() * weight.cwiseSqrt().cwiseProduct(values);
  return result;
}

}  // namespace pencilscan
