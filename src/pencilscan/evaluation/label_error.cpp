#include "pencilscan/evaluation/label_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <tuple>

#include "pencilscan/core/chunks.h"

namespace pencilscan {
namespace {

Vec2 pixel_of(const MeasuredPoint& p) {
  return {static_cast<double>(p.u), static_cast<double>(p.v)};
}

/// Offsets in a unit disc: the centre, six at half radius, twelve on the rim.
std::vector<Vec2> disc_offsets() {
  std::vector<Vec2> offsets = {Vec2::Zero()};
  for (const auto& [radius, count] : {std::pair{0.5, 6}, std::pair{1.0, 12}}) {
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * std::numbers::pi * i / count;
      offsets.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
  }
  return offsets;
}

void mark_duplicates(std::span<const MeasuredPoint> points, std::vector<PointVerdict>& verdicts) {
  const auto key = [&](std::size_t i) {
    const MeasuredPoint& p = points[i];
    return std::tuple(p.camera, p.projector, p.pattern, p.line, std::lround(p.u), std::lround(p.v));
  };
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return key(i) < key(j); });
  for (std::size_t k = 1; k < order.size(); ++k) {
    verdicts[order[k]].counted = key(order[k]) != key(order[k - 1]);
  }
}

/// Error along the ray of (u, v): where the vertex lies on it against where the surface does.
double ray_error(const TruthScene& truth, const MeasuredPoint& p) {
  const Ray ray = truth.rig().cameras[p.camera].ray(pixel_of(p));
  const auto hit = truth.scene().first_hit(ray);
  if (!hit) return std::numeric_limits<double>::infinity();
  return std::abs((position_of(p) - ray.origin).dot(ray.direction) - hit->distance);
}

void judge(const TruthScene& truth, const MeasuredPoint& p, const std::vector<Vec2>& disc,
           const LabelOptions& options, PointVerdict& verdict) {
  const PatternChannel channel{p.projector, p.pattern};
  const Vec2 pixel = pixel_of(p);
  verdict.ray_error_mm = ray_error(truth, p);
  for (const Vec2& offset : disc) {
    const Vec2 at = pixel + options.disc_px * offset;
    const auto sample = sample_line(truth, p.camera, channel, at);
    if (!sample) continue;
    const double per_px = sample->gradient.norm();
    if (!verdict.spacing_px && &offset == disc.data()) verdict.spacing_px = 1 / per_px;
    const double tolerance = std::max(options.tolerance_px * per_px, options.tolerance_lines);
    if (std::abs(sample->coordinate - p.line) > tolerance) continue;
    verdict.right = true;
    const double from_center = distance_to_true_line(truth, p.camera, channel, p.line, pixel);
    verdict.line_error_px =
        std::min(from_center, offset.norm() * options.disc_px +
                                  distance_to_true_line(truth, p.camera, channel, p.line, at));
    return;
  }
}

std::vector<ConfidenceBand> confidence_bands() {
  std::vector<ConfidenceBand> bands;
  for (const double low : {0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999})
    bands.push_back({low, 0, {}});
  return bands;
}

void add_to_band(float confidence, bool right, std::vector<ConfidenceBand>& bands) {
  const double c = std::isfinite(confidence) ? static_cast<double>(confidence) : 0;
  std::size_t b = bands.size() - 1;
  while (b > 0 && c < bands[b].low) --b;
  bands[b].confidence_sum += c;
  bands[b].right.add(right);
}

}  // namespace

std::vector<PointVerdict> judge_points(const TruthScene& truth,
                                       std::span<const MeasuredPoint> points,
                                       const LabelOptions& options) {
  std::vector<PointVerdict> verdicts(points.size());
  mark_duplicates(points, verdicts);
  const auto disc = disc_offsets();
  parallel_chunks(points.size(), [&](std::size_t i) {
    if (verdicts[i].counted) judge(truth, points[i], disc, options, verdicts[i]);
  });
  return verdicts;
}

bool are_of_gray_scan(std::span<const MeasuredPoint> points) {
  const auto is_whole = [](float value) { return value == std::floor(value); };
  // `plane` is a float: what was a little below a half before may be rounded to it.
  const bool on_pixels = std::all_of(points.begin(), points.end(), [&](const MeasuredPoint& p) {
    return is_whole(p.u) && is_whole(p.v) && p.pattern == 0 && p.confidence == 1.0F &&
           std::abs(std::max(p.plane, 0.F) - static_cast<float>(p.line)) <= 0.5F;
  });
  return on_pixels && std::any_of(points.begin(), points.end(),
                                  [&](const MeasuredPoint& p) { return !is_whole(p.plane); });
}

std::vector<PointVerdict> judge_rays(const TruthScene& truth,
                                     std::span<const MeasuredPoint> points) {
  std::vector<PointVerdict> verdicts(points.size());
  mark_duplicates(points, verdicts);
  parallel_chunks(points.size(), [&](std::size_t i) {
    if (verdicts[i].counted) verdicts[i].ray_error_mm = ray_error(truth, points[i]);
  });
  return verdicts;
}

LabelFigures label_figures(const TruthScene& truth, std::span<const MeasuredPoint> points,
                           std::span<const PointVerdict> verdicts) {
  LabelFigures figures;
  figures.wrong_by_projector.resize(truth.rig().projectors.size());
  figures.wrong_by_spacing.resize(kSpacingBandCount);
  figures.right_by_confidence = confidence_bands();
  std::vector<double> errors;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PointVerdict& v = verdicts[i];
    if (!v.counted) continue;
    figures.wrong.add(!v.right);
    add_to_band(points[i].confidence, v.right, figures.right_by_confidence);
    figures.wrong_by_projector[points[i].projector].add(!v.right);
    if (v.spacing_px) {
      figures.wrong_by_spacing[spacing_band(*v.spacing_px)].add(!v.right);
    } else {
      figures.wrong_unlit.add(!v.right);
    }
    if (v.right && std::isfinite(v.line_error_px)) errors.push_back(v.line_error_px);
  }
  figures.line_error_median_px = quantile(errors, 0.5);
  figures.line_error_p90_px = quantile(errors, 0.9);
  figures.largest_wrong_patch_mm2 = largest_wrong_patch_mm2(truth, points, verdicts);
  return figures;
}

SigmaFigures sigma_figures(std::span<const MeasuredPoint> points,
                           std::span<const PointVerdict> verdicts) {
  std::vector<double> sigmas;
  std::vector<double> errors;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!verdicts[i].counted || !(points[i].sigma > 0)) continue;
    sigmas.push_back(static_cast<double>(points[i].sigma));
    errors.push_back(verdicts[i].ray_error_mm);
  }
  return sigma_figures(sigmas, errors);
}

}  // namespace pencilscan
