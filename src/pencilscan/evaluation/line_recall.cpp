#include "pencilscan/evaluation/line_recall.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "pencilscan/core/chunks.h"
#include "pencilscan/evaluation/pixel_index.h"

namespace pencilscan {
namespace {

std::uint64_t line_key(int camera, PatternChannel channel, int line) {
  return static_cast<std::uint64_t>(camera) << 48U |
         static_cast<std::uint64_t>(channel.projector) << 32U |
         static_cast<std::uint64_t>(channel.pattern) << 24U | static_cast<std::uint64_t>(line);
}

/// First channel of the rig that draws with the same colours: names the family.
std::vector<std::uint64_t> families(const Rig& rig, const std::vector<PatternChannel>& channels) {
  std::vector<std::uint64_t> family(channels.size());
  for (std::size_t i = 0; i < channels.size(); ++i) {
    family[i] = i;
    for (std::size_t j = 0; j < i; ++j) {
      if (same_color_family(rig, channels[i], channels[j])) {
        family[i] = j;
        break;
      }
    }
  }
  return family;
}

std::uint64_t family_key(int camera, std::uint64_t family) {
  return static_cast<std::uint64_t>(camera) << 48U | family;
}

double cos_limit(const RecallOptions& options) {
  return std::cos(options.max_incidence_deg * std::numbers::pi / 180);
}

bool steep(const TrueLinePixel& t, double limit) {
  return !(t.cos_camera > limit && t.cos_projector > limit);
}

}  // namespace

std::size_t spacing_band(double spacing_px) {
  std::size_t band = 0;
  for (const double edge : kSpacingBandEdges) band += spacing_px >= edge ? 1 : 0;
  return band;
}

RecallFigures line_recall(const Rig& rig, std::span<const TrueLinePixel> truth,
                          std::span<const MeasuredPoint> points, const RecallOptions& options) {
  const auto channels = pattern_channels(rig);
  const auto family = families(rig, channels);
  const auto family_of = [&](PatternChannel channel) {
    const auto it = std::find(channels.begin(), channels.end(), channel);
    return family[static_cast<std::size_t>(it - channels.begin())];
  };
  PixelIndex labelled(options.radius_px);
  PixelIndex unlabelled(options.radius_px);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MeasuredPoint& p = points[i];
    const PatternChannel channel{p.projector, p.pattern};
    const Vec2 pixel(static_cast<double>(p.u), static_cast<double>(p.v));
    labelled.add(line_key(p.camera, channel, p.line), pixel, i);
    unlabelled.add(family_key(p.camera, family_of(channel)), pixel, i);
  }
  labelled.build();
  unlabelled.build();

  std::vector<unsigned char> found(truth.size());
  std::vector<unsigned char> found_any(truth.size());
  parallel_chunks(truth.size(), [&](std::size_t i) {
    const TrueLinePixel& t = truth[i];
    found[i] = labelled.any(line_key(t.camera, t.channel, t.line), t.pixel, options.radius_px);
    found_any[i] =
        unlabelled.any(family_key(t.camera, family_of(t.channel)), t.pixel, options.radius_px);
  });

  RecallFigures figures;
  figures.by_projector.resize(rig.projectors.size());
  figures.by_spacing.resize(kSpacingBandCount);
  const double limit = cos_limit(options);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const TrueLinePixel& t = truth[i];
    if (steep(t, limit)) continue;
    const bool hit = found[i] != 0;
    figures.by_spacing[spacing_band(t.spacing_px)].add(hit);
    if (t.spacing_px >= options.min_spacing_px) {
      figures.recall.add(hit);
      figures.any_line.add(found_any[i] != 0);
      figures.by_projector[static_cast<std::size_t>(t.channel.projector)].add(hit);
    } else if (t.spacing_px >= options.dense_spacing_px) {
      figures.recall_dense.add(hit);
    }
  }
  return figures;
}

DetectionFigures detection_figures(std::span<const TrueLinePixel> truth,
                                   std::span<const DetectedPoint> detected,
                                   std::span<const PatternChannel> family,
                                   const RecallOptions& options) {
  const auto in_family = [&](const TrueLinePixel& t) {
    return std::find(family.begin(), family.end(), t.channel) != family.end();
  };
  PixelIndex points(options.radius_px);
  for (std::size_t i = 0; i < detected.size(); ++i) {
    points.add(family_key(detected[i].camera, 0), {detected[i].u, detected[i].v}, i);
  }
  points.build();

  DetectionFigures figures;
  PixelIndex lines(options.radius_px);
  const double limit = cos_limit(options);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const TrueLinePixel& t = truth[i];
    if (!in_family(t)) continue;
    lines.add(family_key(t.camera, 0), t.pixel, i);
    if (steep(t, limit) || t.spacing_px < options.dense_spacing_px) continue;
    Share& share = t.spacing_px >= options.min_spacing_px ? figures.recall : figures.recall_dense;
    share.add(points.any(family_key(t.camera, 0), t.pixel, options.radius_px));
  }
  lines.build();

  std::vector<double> errors;
  for (const DetectedPoint& d : detected) {
    const Vec2 pixel(d.u, d.v);
    double nearest = std::numeric_limits<double>::infinity();
    double error = 0;
    lines.visit(family_key(d.camera, 0), pixel, options.radius_px,
                [&](std::size_t id, const Vec2& at) {
                  if ((at - pixel).norm() >= nearest) return;
                  nearest = (at - pixel).norm();
                  error = std::abs((at - pixel).dot(truth[id].across));
                });
    const bool spurious = !std::isfinite(nearest);
    figures.spurious.add(spurious);
    if (!spurious) errors.push_back(error);
  }
  figures.error_median_px = quantile(errors, 0.5);
  figures.error_p90_px = quantile(errors, 0.9);
  return figures;
}

}  // namespace pencilscan
