#include "pencilscan/surface/filter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <unordered_map>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/tally.h"

namespace pencilscan {
namespace {

constexpr int kRounds = 8;
constexpr double kPrior = 0.15;             // votes that an unsupported sample lacks
constexpr double kEnoughSupport = 4.0;      // votes; more curves add no belief
constexpr double kContradictionWeight = 4;  // seeing through is stronger evidence than lying near
constexpr double kSameSetSupport = 0.3;     // a curve of the same camera and projector
constexpr double kSupportRadius = 2.0;      // spacings
constexpr double kAlongRadius = 1.0;        // spacings, averaging along the curve
constexpr double kTubeRadius = 0.15;        // spacings, of a sight or light line
constexpr double kMargin = 0.6;             // spacings before the end of the line

/// One other sample's vote; only the strongest of each group counts.
struct Vote {
  std::uint32_t group;
  std::uint32_t other;
  float weight;
};

/// All votes of one kind, per receiving sample, sorted by group.
using Votes = std::vector<std::vector<Vote>>;

/// Keeps, for each group, the nearest (smallest d2) candidates only, to bound the work.
struct Candidate {
  std::uint32_t group;
  double d2;
  std::uint32_t other;
  float weight;
};

std::vector<Vote> nearest_per_group(std::vector<Candidate>& candidates, std::size_t per_group) {
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.group, a.d2, a.other) < std::tie(b.group, b.d2, b.other);
  });
  std::vector<Vote> votes;
  std::size_t in_group = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    in_group = i > 0 && candidates[i].group == candidates[i - 1].group ? in_group + 1 : 0;
    if (in_group < per_group) {
      votes.push_back({candidates[i].group, candidates[i].other, candidates[i].weight});
    }
  }
  return votes;
}

Votes collect_support(std::span<const SurfaceSample> samples, const PointGrid& grid,
                      double spacing) {
  Votes support(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    const SurfaceSample& p = samples[i];
    std::vector<Candidate> candidates;
    grid.for_each_within(p.position, kSupportRadius * spacing, [&](std::size_t j, double d2) {
      const SurfaceSample& q = samples[j];
      if (q.curve == p.curve || q.normal.dot(p.normal) < 0.3) return;
      // Bent surfaces and tilted normals leave the plane in proportion to the distance.
      const double tolerance = 0.05 * spacing + 0.12 * std::sqrt(d2) + p.sigma + q.sigma;
      if (std::abs((q.position - p.position).dot(p.normal)) > tolerance) return;
      const bool same_set = q.camera == p.camera && q.projector == p.projector;
      candidates.push_back({q.curve, d2, static_cast<std::uint32_t>(j),
                            static_cast<float>(same_set ? kSameSetSupport : 1.0)});
    });
    support[i] = nearest_per_group(candidates, 2);
  });
  return support;
}

/// The samples that one device sees (or lights), in cells of its image.
class ViewBuffer {
 public:
  ViewBuffer(const Device& device, double cell_px) : device_(&device), cell_(cell_px) {}

  void add(std::uint32_t sample, const Vec3& x) {
    const auto pixel = device_->project(x);
    if (!pixel) return;
    entries_[key(cell((*pixel)[0]), cell((*pixel)[1]))].push_back({*pixel, depth(x), sample});
  }

  /// Calls visit(sample, its depth - x's depth) for samples within a cell length of x's pixel.
  template <typename Visit>
  void for_each_near(const Vec3& x, Visit&& visit) const {
    const auto pixel = device_->project(x);
    if (!pixel) return;
    const double z = depth(x);
    const std::int64_t cx = cell((*pixel)[0]);
    const std::int64_t cy = cell((*pixel)[1]);
    for (std::int64_t y = cy - 1; y <= cy + 1; ++y) {
      for (std::int64_t x_cell = cx - 1; x_cell <= cx + 1; ++x_cell) {
        const auto found = entries_.find(key(x_cell, y));
        if (found == entries_.end()) continue;
        for (const Entry& entry : found->second) {
          if ((entry.pixel - *pixel).squaredNorm() <= cell_ * cell_) {
            visit(entry.sample, entry.depth - z);
          }
        }
      }
    }
  }

 private:
  struct Entry {
    Vec2 pixel;
    double depth;
    std::uint32_t sample;
  };
  [[nodiscard]] double depth(const Vec3& x) const { return (device_->device_from_world * x).z(); }
  [[nodiscard]] std::int64_t cell(double px) const {
    return static_cast<std::int64_t>(std::floor(px / cell_));
  }
  [[nodiscard]] static std::uint64_t key(std::int64_t x, std::int64_t y) {
    return static_cast<std::uint64_t>(x) << 32 ^ (static_cast<std::uint64_t>(y) & 0xffffffffu);
  }

  const Device* device_;
  double cell_;
  std::unordered_map<std::uint64_t, std::vector<Entry>> entries_;
};

std::vector<ViewBuffer> make_views(const Rig& rig, std::span<const SurfaceSample> samples,
                                   double spacing) {
  std::vector<const Device*> devices;
  for (const Camera& camera : rig.cameras) devices.push_back(&camera);
  for (const Projector& projector : rig.projectors) devices.push_back(&projector);
  Vec3 center = Vec3::Zero();
  for (const SurfaceSample& s : samples) center += s.position;
  center /= static_cast<double>(std::max<std::size_t>(samples.size(), 1));
  std::vector<ViewBuffer> views;
  for (const Device* device : devices) {
    const double z = std::max((device->device_from_world * center).z(), spacing);
    views.emplace_back(*device, std::max(kTubeRadius * spacing * device->focal_px() / z, 0.5));
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto id = static_cast<std::uint32_t>(i);
    views[samples[i].camera].add(id, samples[i].position);
    views[rig.cameras.size() + samples[i].projector].add(id, samples[i].position);
  }
  return views;
}

Votes collect_contradictions(const Rig& rig, std::span<const SurfaceSample> samples,
                             double spacing) {
  const std::vector<ViewBuffer> views = make_views(rig, samples, spacing);
  const auto center = [&](std::size_t view) {
    return view < rig.cameras.size() ? rig.cameras[view].center()
                                     : rig.projectors[view - rig.cameras.size()].center();
  };
  Votes contradictions(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    const SurfaceSample& p = samples[i];
    std::vector<Candidate> candidates;
    for (std::size_t view = 0; view < views.size(); ++view) {
      // A sample seen edge-on stands beside the line, not in it.
      const double facing = std::abs((center(view) - p.position).normalized().dot(p.normal));
      views[view].for_each_near(p.position, [&](std::uint32_t q, double behind) {
        if (behind < kMargin * spacing + 3 * (p.sigma + samples[q].sigma)) return;
        if (samples[q].curve == p.curve && view < rig.cameras.size()) return;
        candidates.push_back(
            {static_cast<std::uint32_t>(view), behind, q, static_cast<float>(facing)});
      });
    }
    contradictions[i] = nearest_per_group(candidates, 4);
  });
  // Whoever is blocked hears it from the blocker too: groups above the views, one per camera.
  const std::size_t blockers = samples.size();
  std::vector<std::vector<Vote>> heard(blockers);
  for (std::size_t i = 0; i < blockers; ++i) {
    for (const Vote& vote : contradictions[i]) {
      const auto group = static_cast<std::uint32_t>(views.size() + samples[i].camera);
      heard[vote.other].push_back({group, static_cast<std::uint32_t>(i), vote.weight});
    }
  }
  for (std::size_t i = 0; i < blockers; ++i) {
    std::stable_sort(heard[i].begin(), heard[i].end(),
                     [](const Vote& a, const Vote& b) { return a.group < b.group; });
    contradictions[i].insert(contradictions[i].end(), heard[i].begin(), heard[i].end());
  }
  return contradictions;
}

/// Samples of the same curve within kAlongRadius, the sample itself included.
std::vector<std::vector<std::uint32_t>> collect_along(std::span<const SurfaceSample> samples,
                                                      const PointGrid& grid, double spacing) {
  std::vector<std::vector<std::uint32_t>> along(samples.size());
  parallel_chunks(samples.size(), [&](std::size_t i) {
    grid.for_each_within(samples[i].position, kAlongRadius * spacing, [&](std::size_t j, double) {
      if (samples[j].curve == samples[i].curve) along[i].push_back(static_cast<std::uint32_t>(j));
    });
  });
  return along;
}

}  // namespace

std::vector<double> vote(const Rig& rig, std::span<const SurfaceSample> samples,
                         const PointGrid& grid, double spacing) {
  const Votes support = collect_support(samples, grid, spacing);
  const Votes contradictions = collect_contradictions(rig, samples, spacing);
  const auto along = collect_along(samples, grid, spacing);
  std::vector<double> belief(samples.size(), 1.0);
  std::vector<double> s(samples.size());
  std::vector<double> c(samples.size());
  const auto believed = [&](const Vote& vote) {
    return belief[vote.other] * static_cast<double>(vote.weight);
  };
  for (int round = 0; round < kRounds; ++round) {
    parallel_chunks(samples.size(), [&](std::size_t i) {
      s[i] = tally(support[i], believed);
      c[i] = tally(contradictions[i], believed);
    });
    parallel_chunks(samples.size(), [&](std::size_t i) {
      double s_mean = 0;
      double c_mean = 0;
      for (const std::uint32_t j : along[i]) {
        s_mean += s[j];
        c_mean += c[j];
      }
      const auto n = static_cast<double>(along[i].size());
      const double supported = std::min(s_mean / n, kEnoughSupport);
      belief[i] = supported / (supported + kContradictionWeight * c_mean / n + kPrior);
    });
  }
  return belief;
}

void drop_small_clusters(std::span<const SurfaceSample> samples, double gap_mm, double min_share,
                         std::vector<char>& keep) {
  std::vector<std::size_t> kept;
  std::vector<Vec3> positions;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!keep[i]) continue;
    kept.push_back(i);
    positions.push_back(samples[i].position);
  }
  const PointGrid grid(positions, gap_mm);
  std::vector<int> cluster(kept.size(), -1);
  std::vector<std::size_t> sizes;
  std::vector<std::size_t> open;
  for (std::size_t seed = 0; seed < kept.size(); ++seed) {
    if (cluster[seed] >= 0) continue;
    const int name = static_cast<int>(sizes.size());
    sizes.push_back(0);
    cluster[seed] = name;
    open.push_back(seed);
    while (!open.empty()) {
      const std::size_t i = open.back();
      open.pop_back();
      ++sizes.back();
      grid.for_each_within(positions[i], gap_mm, [&](std::size_t j, double) {
        if (cluster[j] >= 0) return;
        cluster[j] = name;
        open.push_back(j);
      });
    }
  }
  if (sizes.empty()) return;
  const auto largest = static_cast<double>(*std::max_element(sizes.begin(), sizes.end()));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const auto size = static_cast<double>(sizes[static_cast<std::size_t>(cluster[k])]);
    if (size < min_share * largest) keep[kept[k]] = 0;
  }
}

}  // namespace pencilscan
