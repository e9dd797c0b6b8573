#include "pencilscan/page/albedo.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

std::uint64_t cell(std::size_t camera, long u, long v) {
  return (static_cast<std::uint64_t>(camera) << 48U) |
         ((static_cast<std::uint64_t>(u + 1) & 0xFFFFFFU) << 24U) |
         (static_cast<std::uint64_t>(v + 1) & 0xFFFFFFU);
}

/// Finds the curve point at a pixel.
class SampleIndex {
 public:
  explicit SampleIndex(const CurveFile& curves) : samples_(curves.samples) {
    by_cell_.reserve(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const CurveSample& s = samples_[i];
      by_cell_.emplace(cell(s.camera, std::lround(s.u), std::lround(s.v)), i);
    }
  }
  /// The nearest one of the point's label within a pixel and a half; null for none.
  [[nodiscard]] const CurveSample* at(const MeasuredPoint& point) const {
    const CurveSample* best = nullptr;
    float least = 1.5F * 1.5F;
    for (long dv = -1; dv <= 1; ++dv) {
      for (long du = -1; du <= 1; ++du) {
        const auto key = cell(point.camera, std::lround(point.u) + du, std::lround(point.v) + dv);
        for (auto [it, end] = by_cell_.equal_range(key); it != end; ++it) {
          const CurveSample& s = samples_[it->second];
          const float d = (s.u - point.u) * (s.u - point.u) + (s.v - point.v) * (s.v - point.v);
          if (s.projector != point.projector || s.line != point.line || d >= least) continue;
          least = d;
          best = &s;
        }
      }
    }
    return best;
  }

 private:
  const std::vector<CurveSample>& samples_;
  std::unordered_multimap<std::uint64_t, std::size_t> by_cell_;
};

/// Vertices without a value take the mean of those beside them, several times over.
void fill_gaps(const TriangleMesh& mesh, std::vector<float>& values) {
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<float> sum(values.size(), 0);
    std::vector<int> count(values.size(), 0);
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto from = static_cast<std::size_t>(face[k]);
        const auto to = static_cast<std::size_t>(face[(k + 1) % 3]);
        if (std::isnan(values[to]) && !std::isnan(values[from])) {
          sum[to] += values[from];
          ++count[to];
        } else if (std::isnan(values[from]) && !std::isnan(values[to])) {
          sum[from] += values[to];
          ++count[from];
        }
      }
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (count[i] > 0) values[i] = sum[i] / static_cast<float>(count[i]);
    }
  }
}

void scale_to_one(AlbedoEstimate& estimate) {
  std::vector<float> known;
  for (const float a : estimate.points) {
    if (!std::isnan(a)) known.push_back(a);
  }
  if (known.empty()) return;
  const float high = lower_quantile(std::move(known), 0.95);
  const float factor = high > 0 ? 0.9F / high : 1.0F;
  for (float& a : estimate.points) a *= factor;
}

}  // namespace

AlbedoEstimate estimate_albedo(const Rig& rig, std::span<const MeasuredPoint> points,
                               const CurveFile& curves, const RayScene& surface) {
  const SampleIndex index(curves);
  const TriangleMesh& mesh = surface.mesh();
  AlbedoEstimate estimate;
  estimate.points.assign(points.size(), kNone);
  std::vector<std::size_t> face(points.size(), mesh.faces.size());
  parallel_for(points.size(), [&](std::size_t i) {
    const MeasuredPoint& p = points[i];
    if (p.projector >= rig.projectors.size()) return;
    const CurveSample* sample = index.at(p);
    if (sample == nullptr) return;
    const Vec3 x(p.x, p.y, p.z);
    const auto closest = surface.closest_point(x);
    if (!closest) return;
    const Vec3 to_light = rig.projectors[p.projector].center() - x;
    const double cosine = face_normal(mesh, closest->face).dot(to_light.normalized());
    constexpr double kGrazing = 0.25;  // beyond it the normal's error counts too much
    if (cosine < kGrazing) return;
    estimate.points[i] = static_cast<float>(sample->amplitude * to_light.squaredNorm() / cosine);
    face[i] = closest->face;
  });
  scale_to_one(estimate);
  std::vector<float> sum(mesh.vertices.size(), 0);
  std::vector<float> count(mesh.vertices.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (face[i] == mesh.faces.size()) continue;
    for (const int vertex : mesh.faces[face[i]]) {
      sum[static_cast<std::size_t>(vertex)] += estimate.points[i];
      ++count[static_cast<std::size_t>(vertex)];
    }
  }
  estimate.vertices.assign(mesh.vertices.size(), kNone);
  for (std::size_t i = 0; i < sum.size(); ++i) {
    if (count[i] > 0) estimate.vertices[i] = sum[i] / count[i];
  }
  fill_gaps(mesh, estimate.vertices);
  return estimate;
}

std::vector<std::uint8_t> albedo_bytes(std::span<const float> albedo) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(albedo.size());
  for (const float a : albedo) {
    const double shown =
        255 * std::pow(std::clamp(std::isnan(a) ? 0.0 : double(a), 0.0, 1.0), 1 / 2.2);
    bytes.push_back(std::isnan(a) ? 0
                                  : static_cast<std::uint8_t>(std::max(1L, std::lround(shown))));
  }
  return bytes;
}

}  // namespace pencilscan
