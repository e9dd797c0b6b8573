#include "pencilscan/guided/named_ends.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Share of an end's offset that the i-th of n points of a guess takes, counted from that end.
float share_at(int i, int n, bool has_other, int most) {
  const auto length = static_cast<float>(has_other ? n + 1 : most + 1);
  return std::max(0.F, 1 - static_cast<float>(i + 1) / length);
}

}  // namespace

bool ContinuedLine::is_of_end(const CurvePoint& p) const {
  constexpr float kAlong = 0.5F;  // px; points of a curve lie 1 px apart
  constexpr float kAcross = 1.5F;
  return std::any_of(ends.begin(), ends.end(), [&](const Curve& end) {
    return std::any_of(end.points.begin(), end.points.end(), [&](const CurvePoint& q) {
      const Vector2f way = p.position - q.position;
      return std::abs(way.dot(q.tangent())) < kAlong && std::abs(way.dot(q.normal)) < kAcross;
    });
  });
}

float ContinuedLine::amplitude_within() const {
  float least = ends.empty() ? 0 : ends.front().points.back().amplitude;
  for (const Curve& end : ends) least = std::min(least, end.points.back().amplitude);
  return least;
}

NamedEnds::NamedEnds(const Camera& camera, std::span<const Curve> curves,
                     std::span<const LabeledRun> runs, const std::vector<char>& subtracted)
    : curves_(curves), runs_(runs), named_(places_of_runs(camera, curves, runs, subtracted)) {}

/// Points of the curve that shows a line beyond the end of a guess, the nearest first.
std::vector<CurvePoint> NamedEnds::beyond(const CurvePoint& end, const Vector2f& outward,
                                          const LineName& name, int most) const {
  // px: a predicted point that a named one shows lies within 1.5 px of it, and predicted points of
  // a line up to 2.5 px apart.
  constexpr float kAlong = 4;
  constexpr float kAcross = 1.5F;
  float nearest = kAlong;
  const RunPoint* found = nullptr;
  named_.around(end.position, kAlong, [&](const RunPoint& n) {
    const LabeledRun& run = runs_[n.run];
    if (!(LineName{run.label.pattern, run.label.line} == name)) return;
    const CurvePoint& p =
        curves_[static_cast<std::size_t>(run.curve)].points[static_cast<std::size_t>(n.point)];
    const Vector2f way = p.position - end.position;
    const float along = way.dot(outward);
    if (along <= 0 || along >= nearest || std::abs(way.dot(end.normal)) > kAcross) return;
    nearest = along;
    found = &n;
  });
  std::vector<CurvePoint> points;
  if (found == nullptr) return points;
  const LabeledRun& run = runs_[found->run];
  const std::vector<CurvePoint>& of_curve = curves_[static_cast<std::size_t>(run.curve)].points;
  const auto at = [&](int i) -> const CurvePoint& { return of_curve[static_cast<std::size_t>(i)]; };
  const int other = found->point + 1 < run.end ? found->point + 1 : found->point - 1;
  if (other < run.begin) return points;
  const bool ahead = (at(other).position - at(found->point).position).dot(outward) > 0;
  const int step = ahead == (other > found->point) ? 1 : -1;
  for (int i = found->point; i >= run.begin && i < run.end; i += step) {
    if (static_cast<int>(points.size()) == most) break;
    points.push_back(at(i));
  }
  return points;
}

ContinuedLine NamedEnds::continued(Curve guess, const LineName& name, int most) const {
  const std::vector<CurvePoint>& points = guess.points;
  const auto n = static_cast<int>(points.size());
  const Vector2f chord = points.back().position - points.front().position;
  const auto outward = [&](const CurvePoint& end, float sign) -> Vector2f {
    const Vector2f tangent = end.tangent();
    return n > 1 && tangent.dot(chord) < 0 ? -sign * tangent : sign * tangent;
  };
  std::vector<CurvePoint> before = beyond(points.front(), outward(points.front(), -1), name, most);
  std::vector<CurvePoint> after = beyond(points.back(), outward(points.back(), 1), name, most);

  ContinuedLine line;
  std::vector<CurvePoint> moved = points;
  const auto take = [&](std::vector<CurvePoint>& end, bool is_first) {
    if (end.empty()) return;
    line.ends.push_back({guess.family, end, {}});
    const CurvePoint& last = is_first ? points.front() : points.back();
    const float aside = (end.front().position - last.position).dot(last.normal);
    const bool has_other = !(is_first ? after : before).empty();
    for (int i = 0; i < n; ++i) {
      CurvePoint& p = moved[static_cast<std::size_t>(is_first ? i : n - 1 - i)];
      p.position += share_at(i, n, has_other, most) * aside * p.normal;
    }
    // Profiles are averaged: all have one side on the left.
    for (CurvePoint& p : end) {
      if (p.normal.dot(last.normal) < 0) p.normal = -p.normal;
    }
  };
  take(before, true);
  take(after, false);
  line.curve.family = guess.family;
  std::vector<CurvePoint>& all = line.curve.points;
  all.assign(before.rbegin(), before.rend());
  all.insert(all.end(), moved.begin(), moved.end());
  all.insert(all.end(), after.begin(), after.end());
  return line;
}

}  // namespace pencilscan
