#include "pencilscan/depth/consistency.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/tally.h"
#include "pencilscan/depth/pruning.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// A measured node of any map.
struct Node {
  Vec3 x;  ///< world
  std::uint32_t map;
  std::uint32_t index;  ///< in its map
};

/// Another node that agrees or disagrees, with the device through which that was found.
struct Link {
  std::uint32_t other;
  std::uint16_t group;     ///< map; maps + projector; or these + a map that contradicts
  float disagreement = 0;  ///< of a support: distance across the surface over its deviation; NaN:
                           ///< the two are the two sides of a sheet
};

struct Links {
  std::vector<std::vector<Link>> support;
  std::vector<std::vector<Link>> contradiction;
};

/// The four nodes around a pixel, or fewer at the border.
std::array<std::int64_t, 4> nodes_around(const DepthMap& map, const Vec2& pixel) {
  const int c = static_cast<int>(std::floor(pixel[0] / map.stride));
  const int r = static_cast<int>(std::floor(pixel[1] / map.stride));
  std::array<std::int64_t, 4> around{-1, -1, -1, -1};
  std::size_t k = 0;
  for (int dr = 0; dr < 2; ++dr) {
    for (int dc = 0; dc < 2; ++dc, ++k) {
      if (r + dr < 0 || c + dc < 0 || r + dr >= map.rows || c + dc >= map.columns) continue;
      around[k] = static_cast<std::int64_t>(map.index(r + dr, c + dc));
    }
  }
  return around;
}

class Comparison {
 public:
  Comparison(const Rig& rig, std::span<const int> pattern_projector, std::span<const DepthMap> maps,
             const ConsistencyOptions& options)
      : rig_(rig),
        pattern_projector_(pattern_projector),
        maps_(maps),
        margin_(std::max(options.margin, options.margin_lines * line_spacing(rig))) {
    id_of_.resize(maps.size());
    for (std::size_t m = 0; m < maps.size(); ++m) {
      id_of_[m].assign(maps[m].nodes.size(), -1);
      for (std::size_t i = 0; i < maps[m].nodes.size(); ++i) {
        if (!maps[m].nodes[i].measured()) continue;
        id_of_[m][i] = static_cast<std::int32_t>(nodes_.size());
        nodes_.push_back({node_point(rig, maps[m], i), static_cast<std::uint32_t>(m),
                          static_cast<std::uint32_t>(i)});
      }
    }
  }

  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  [[nodiscard]] std::int32_t id(std::size_t map, std::size_t node) const {
    return id_of_[map][node];
  }

  [[nodiscard]] Links compare() const {
    Links links;
    links.support.resize(nodes_.size());
    links.contradiction.resize(nodes_.size());
    parallel_chunks(nodes_.size(), [&](std::size_t i) { compare_with_cameras(i, links); });
    for (std::size_t p = 0; p < rig_.projectors.size(); ++p) compare_with_projector(p, links);
    // Whoever contradicts is contradicted: by groups of their own, after those of maps and
    // projectors.
    const std::size_t voices = maps_.size() + rig_.projectors.size();
    std::vector<std::vector<Link>> heard(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      for (const Link& link : links.contradiction[i]) {
        heard[link.other].push_back(
            {static_cast<std::uint32_t>(i), static_cast<std::uint16_t>(voices + nodes_[i].map)});
      }
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      auto& mine = links.contradiction[i];
      mine.insert(mine.end(), heard[i].begin(), heard[i].end());
      std::stable_sort(mine.begin(), mine.end(),
                       [](const Link& a, const Link& b) { return a.group < b.group; });
    }
    return links;
  }

 private:
  [[nodiscard]] const DepthNode& node(std::size_t i) const {
    return maps_[nodes_[i].map].nodes[nodes_[i].index];
  }

  /// Distance of node i from the surface at `other`, seen `beyond` it by the other's camera, over
  /// the standard deviation that the two of them state; below zero where that is nearer. NaN where
  /// they face away from each other: a sheet lies between them, and no error.
  [[nodiscard]] float disagreement(std::size_t i, std::size_t other, double beyond) const {
    const auto normal = [&](std::size_t k) {
      return node_normal(rig_, maps_[nodes_[k].map], nodes_[k].index);
    };
    const auto cosine = [&](std::size_t k, const Vec3& n) {
      const auto camera = static_cast<std::size_t>(maps_[nodes_[k].map].camera);
      return (rig_.cameras[camera].center() - nodes_[k].x).normalized().dot(n);
    };
    const Vec3 there = normal(other);
    const Vec3 here = normal(i);
    if (here.dot(there) < 0) return std::numeric_limits<float>::quiet_NaN();
    const double c = cosine(other, there);
    const double sigma = std::hypot(c * static_cast<double>(node(other).sigma),
                                    cosine(i, here) * static_cast<double>(node(i).sigma));
    return static_cast<float>(c * beyond / std::max(sigma, 1e-9));
  }

  void compare_with_cameras(std::size_t i, Links& links) const {
    for (std::size_t m = 0; m < maps_.size(); ++m) {
      if (m == nodes_[i].map) continue;
      const Camera& camera = rig_.cameras[static_cast<std::size_t>(maps_[m].camera)];
      const auto pixel = camera.project(nodes_[i].x);
      if (!pixel || !camera.contains(*pixel)) continue;
      const double z = (camera.device_from_world * nodes_[i].x).z();
      double nearest = 1e9;  // signed: what the camera sees, beyond the node
      std::int32_t other = -1;
      int count = 0;
      double least_px2 = 1e9;  // of the node next to the pixel
      double there = 0;
      std::int32_t next = -1;
      for (const std::int64_t j : nodes_around(maps_[m], *pixel)) {
        if (j < 0) continue;
        const DepthNode& n = maps_[m].nodes[static_cast<std::size_t>(j)];
        if (!n.measured()) continue;
        ++count;
        const Vec2 d = *pixel - maps_[m].pixel(static_cast<std::size_t>(j));
        const double w = n.w + n.wx * d[0] + n.wy * d[1] +
                         0.5 * (n.wxx * d[0] * d[0] + n.wyy * d[1] * d[1]) + n.wxy * d[0] * d[1];
        if (!(w > 0)) continue;
        const double beyond = 1 / w - z;
        if (d.squaredNorm() < least_px2) {
          least_px2 = d.squaredNorm();
          there = beyond;
          next = id_of_[m][static_cast<std::size_t>(j)];
        }
        if (std::abs(beyond) < std::abs(nearest)) {
          nearest = beyond;
          other = id_of_[m][static_cast<std::size_t>(j)];
        }
      }
      if (other < 0) continue;
      const double sigma =
          static_cast<double>(node(i).sigma + node(static_cast<std::size_t>(other)).sigma);
      const Link link{static_cast<std::uint32_t>(other), static_cast<std::uint16_t>(m)};
      if (std::abs(nearest) < 0.5 * margin_ + 3 * sigma) {
        links.support[i].push_back(
            {link.other, link.group, disagreement(i, static_cast<std::size_t>(next), there)});
      } else if (nearest > margin_ + 4 * sigma && count >= 3) {
        links.contradiction[i].push_back(link);
      }
    }
  }

  /// Nodes that stand in the light of others.
  void compare_with_projector(std::size_t p, Links& links) const {
    const Projector& projector = rig_.projectors[p];
    // As wide as the margin: what slants by less than two in one does not stand in its own light.
    const double cell = std::max(1.0, pixels_at_center(rig_, projector, margin_));
    const int columns = static_cast<int>(projector.width / cell) + 1;
    const int rows = static_cast<int>(projector.height / cell) + 1;
    LitPatterns own;
    for (std::size_t k = 0; k < pattern_projector_.size(); ++k) {
      if (pattern_projector_[k] == static_cast<int>(p)) own.set(k);
    }
    // The second farthest lit node of each cell: a single wrong one shall not cast doubt on all
    // that stands before it.
    struct Lit {
      float z = 0;
      std::int32_t node = -1;
      float farthest = 0;
      std::int32_t farthest_node = -1;
    };
    std::vector<Lit> farthest(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    std::vector<std::int32_t> cell_of(nodes_.size(), -1);
    std::vector<float> z_of(nodes_.size());
    parallel_chunks(nodes_.size(), [&](std::size_t i) {
      const auto pixel = projector.project(nodes_[i].x);
      if (!pixel || !projector.contains(*pixel)) return;
      cell_of[i] = static_cast<std::int32_t>(((*pixel)[1] + 0.5) / cell) * columns +
                   static_cast<std::int32_t>(((*pixel)[0] + 0.5) / cell);
      z_of[i] = static_cast<float>((projector.device_from_world * nodes_[i].x).z());
    });
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (cell_of[i] < 0 || (maps_[nodes_[i].map].lit(node(i)) & own).none()) continue;
      Lit& lit = farthest[static_cast<std::size_t>(cell_of[i])];
      if (z_of[i] > lit.farthest) {
        lit = {lit.farthest, lit.farthest_node, z_of[i], static_cast<std::int32_t>(i)};
      } else if (z_of[i] > lit.z) {
        lit.z = z_of[i];
        lit.node = static_cast<std::int32_t>(i);
      }
    }
    parallel_chunks(nodes_.size(), [&](std::size_t i) {
      if (cell_of[i] < 0) return;
      const Lit& lit = farthest[static_cast<std::size_t>(cell_of[i])];
      if (lit.node < 0 || lit.node == static_cast<std::int32_t>(i)) return;
      const double sigma =
          static_cast<double>(node(i).sigma + node(static_cast<std::size_t>(lit.node)).sigma);
      if (static_cast<double>(lit.z - z_of[i]) < 2 * margin_ + 4 * sigma) return;
      links.contradiction[i].push_back(
          {static_cast<std::uint32_t>(lit.node), static_cast<std::uint16_t>(maps_.size() + p)});
    });
  }

  const Rig& rig_;
  std::span<const int> pattern_projector_;
  std::span<const DepthMap> maps_;
  double margin_;
  std::vector<Node> nodes_;
  std::vector<std::vector<std::int32_t>> id_of_;
};

/// What the stated deviations must be multiplied with so that cameras disagree as they should: 1.48
/// times the median of the absolute normalised differences is 1 for normal errors.
double sigma_scale(const Links& links) {
  constexpr double kUsual = 1.7;  // of the rendered scenes, where one camera is all there is
  std::vector<float> ratios;
  for (const auto& of_node : links.support) {
    for (const Link& link : of_node)
      if (!std::isnan(link.disagreement)) ratios.push_back(std::abs(link.disagreement));
  }
  constexpr std::size_t kEnough = 200;
  if (ratios.size() < kEnough) return kUsual;
  return kDeviationPerMedian * static_cast<double>(upper_median(std::move(ratios)));
}

/// What neighbouring places have in common of the disagreement: a device that stands elsewhere than
/// the rig says moves whole surfaces, noise and what is as fine as lines moves every window by
/// itself. Of the medians m, n of blocks side by side that is the root of their covariance
/// (s^2 of m + n - s^2 of m - n) / 4, with s from medians (R. Gnanadesikan and J. R. Kettenring,
/// Biometrics 28, 1972). Nothing where blocks are few.
std::optional<double> shared_scale(const std::vector<Node>& nodes, std::span<const DepthMap> maps,
                                   const Links& links) {
  // Windows reach over less than half of a block, so that noise of two has little in common.
  constexpr int kBlock = 8;  // nodes
  constexpr std::size_t kLeastOfBlock = 10;
  constexpr std::size_t kLeastPairs = 20;  // s is then known to a sixth
  // Blocks of the nodes of one map, as another map sees them.
  std::map<std::pair<std::uint32_t, std::uint16_t>, std::vector<std::vector<float>>> seen;
  const auto across = [&](std::uint32_t m) { return maps[m].columns / kBlock + 1; };
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const DepthMap& map = maps[nodes[i].map];
    const auto index = static_cast<int>(nodes[i].index);
    const int block =
        index / map.columns / kBlock * across(nodes[i].map) + index % map.columns / kBlock;
    for (const Link& link : links.support[i]) {
      if (std::isnan(link.disagreement)) continue;
      auto& blocks = seen[{nodes[i].map, link.group}];
      if (blocks.empty())
        blocks.resize(static_cast<std::size_t>((map.rows / kBlock + 1) * across(nodes[i].map)));
      blocks[static_cast<std::size_t>(block)].push_back(link.disagreement);
    }
  }
  std::vector<float> sums;
  std::vector<float> differences;
  for (const auto& [pair, blocks] : seen) {
    std::vector<std::optional<float>> medians;
    for (const auto& block : blocks)
      medians.push_back(block.size() < kLeastOfBlock ? std::nullopt
                                                     : std::optional(upper_median(block)));
    const auto columns = static_cast<std::size_t>(across(pair.first));
    const auto add = [&](std::size_t i, std::size_t j) {
      if (j >= medians.size() || !medians[i] || !medians[j]) return;
      sums.push_back(std::abs(*medians[i] + *medians[j]));
      differences.push_back(std::abs(*medians[i] - *medians[j]));
    };
    for (std::size_t i = 0; i < medians.size(); ++i) {
      if ((i + 1) % columns != 0) add(i, i + 1);
      add(i, i + columns);
    }
  }
  if (sums.size() < kLeastPairs) return std::nullopt;
  const auto sum = static_cast<double>(upper_median(std::move(sums)));
  const auto difference = static_cast<double>(upper_median(std::move(differences)));
  return kDeviationPerMedian * std::sqrt(std::max(0.0, sum * sum - difference * difference)) / 2;
}

constexpr double kUnseenErrors = 1.15;  // what the cameras have in common, as a factor

void scale_sigma(double factor, std::span<DepthMap> maps) {
  for (DepthMap& map : maps) {
    for (DepthNode& node : map.nodes) node.sigma *= static_cast<float>(factor);
  }
}

/// What the fit of a window cannot see: on a slanted surface the quadric bends more within it, and
/// at the rim it leans on one side. Factors from rendered bunny, hand and balls.
void widen_uncertain(const Rig& rig, std::span<DepthMap> maps) {
  constexpr double kSlanted = 0.6;  // cosine of the incidence below which slant shows
  for (DepthMap& map : maps) {
    const Vec3 eye = rig.cameras[static_cast<std::size_t>(map.camera)].center();
    std::vector<float> factor(map.nodes.size(), 1.F);
    parallel_chunks(map.nodes.size(), [&](std::size_t i) {
      if (!map.nodes[i].measured()) return;
      int neighbors = 0;
      for_each_neighbor(map, i, 1, [&](std::size_t) { ++neighbors; });
      const double cosine =
          (eye - node_point(rig, map, i)).normalized().dot(node_normal(rig, map, i));
      const double slant = 1 + 0.5 * std::clamp((kSlanted - cosine) / 0.2, 0.0, 1.0);
      const double rim = neighbors >= 7 ? 1 : neighbors >= 2 ? 1.3 : 1.8;
      factor[i] = static_cast<float>(slant * rim);
    });
    for (std::size_t i = 0; i < factor.size(); ++i) map.nodes[i].sigma *= factor[i];
  }
}

}  // namespace

Vec3 node_point(const Rig& rig, const DepthMap& map, std::size_t node) {
  return rig.cameras[static_cast<std::size_t>(map.camera)].point_at_depth(
      map.pixel(node), 1 / static_cast<double>(map.nodes[node].w));
}

Vec3 node_normal(const Rig& rig, const DepthMap& map, std::size_t node) {
  const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
  const DepthNode& n = map.nodes[node];
  const Vec2 m = camera.normalized_from_pixel(map.pixel(node));
  // w = omega . (x, y, 1).
  const Vec2 slope = camera.pixel_slope(m).transpose() * Eigen::Vector2f(n.wx, n.wy).cast<double>();
  const Vec3 omega(slope[0], slope[1], static_cast<double>(n.w) - slope.dot(m));
  return -(camera.device_from_world.rotation.transpose() * omega.normalized());
}

ConsistencyReport check_consistency(const Rig& rig, std::span<const int> pattern_projector,
                                    std::span<DepthMap> maps, const ConsistencyOptions& options) {
  ConsistencyReport report;
  widen_uncertain(rig, maps);
  const Comparison comparison(rig, pattern_projector, maps, options);
  const Links links = comparison.compare();
  const std::size_t count = comparison.nodes().size();
  std::vector<float> belief(count, 1.F);
  std::vector<float> support(count);
  std::vector<float> contradiction(count);
  const auto weight = static_cast<float>(options.contradiction_weight);
  const auto belief_of = [&](const Link& link) { return belief[link.other]; };
  for (int round = 0; round < options.rounds; ++round) {
    parallel_chunks(count, [&](std::size_t i) {
      support[i] = tally(links.support[i], belief_of);
      contradiction[i] = tally(links.contradiction[i], belief_of);
    });
    parallel_chunks(count, [&](std::size_t i) {
      const Node& node = comparison.nodes()[i];
      float s = support[i];
      float c = contradiction[i];
      float n = 1;
      for_each_neighbor(maps[node.map], node.index, 2, [&](std::size_t j) {
        const auto k = static_cast<std::size_t>(comparison.id(node.map, j));
        s += support[k];
        c += contradiction[k];
        n += 1;
      });
      belief[i] = (1 + s / n) / (1 + s / n + weight * c / n);
    });
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Node& node = comparison.nodes()[i];
    DepthNode& n = maps[node.map].nodes[node.index];
    n.confidence = belief[i];
    n.support = support[i];
    if (belief[i] >= static_cast<float>(options.min_confidence)) continue;
    n.w = 0;
    n.reason = HoleReason::kContradicted;
    ++report.contradicted;
  }
  report.sigma_scale = sigma_scale(links);
  report.shared_scale = shared_scale(comparison.nodes(), maps, links);
  report.sigma_factor = kUnseenErrors * std::clamp(report.sigma_scale, 1 / kUnseenErrors, 4.0);
  scale_sigma(report.sigma_factor, maps);
  for (DepthMap& map : maps) {
    report.unconfirmed += drop_lone_nodes(map);
    report.unconfirmed += drop_unconfirmed_patches(map);
    report.islands += drop_islands(options.min_component, map);
  }
  return report;
}

}  // namespace pencilscan
