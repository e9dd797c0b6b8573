#include "pencilscan/depth/consistency.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"

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
  std::uint16_t group;      ///< camera, or cameras + projector
  float disagreement = -1;  ///< of a support: distance across the surface over its deviation
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
      : rig_(rig), pattern_projector_(pattern_projector), maps_(maps), options_(options) {
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
    // Whoever contradicts is contradicted.
    std::vector<std::vector<Link>> heard(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      for (const Link& link : links.contradiction[i]) {
        heard[link.other].push_back(
            {static_cast<std::uint32_t>(i), static_cast<std::uint16_t>(1000 + nodes_[i].map)});
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
  /// the standard deviation that the two of them state.
  [[nodiscard]] float disagreement(std::size_t i, std::size_t other, double beyond) const {
    const auto cosine = [&](std::size_t k) {
      const DepthMap& map = maps_[nodes_[k].map];
      const Vec3& eye = rig_.cameras[static_cast<std::size_t>(map.camera)].center();
      return (eye - nodes_[k].x).normalized().dot(node_normal(rig_, map, nodes_[k].index));
    };
    const double c = cosine(other);
    const double sigma = std::hypot(c * static_cast<double>(node(other).sigma),
                                    cosine(i) * static_cast<double>(node(i).sigma));
    return static_cast<float>(std::abs(c * beyond) / std::max(sigma, 1e-9));
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
      if (std::abs(nearest) < 0.5 * options_.margin_mm + 3 * sigma) {
        links.support[i].push_back(
            {link.other, link.group, disagreement(i, static_cast<std::size_t>(next), there)});
      } else if (nearest > options_.margin_mm + 4 * sigma && count >= 3) {
        links.contradiction[i].push_back(link);
      }
    }
  }

  /// Nodes that stand in the light of others.
  void compare_with_projector(std::size_t p, Links& links) const {
    const Projector& projector = rig_.projectors[p];
    constexpr int kCell = 3;  // projector px
    const int columns = projector.width / kCell + 1;
    const int rows = projector.height / kCell + 1;
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < pattern_projector_.size() && k < 64; ++k) {
      if (pattern_projector_[k] == static_cast<int>(p)) bits |= std::uint64_t{1} << k;
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
      cell_of[i] = static_cast<std::int32_t>(((*pixel)[1] + 0.5) / kCell) * columns +
                   static_cast<std::int32_t>(((*pixel)[0] + 0.5) / kCell);
      z_of[i] = static_cast<float>((projector.device_from_world * nodes_[i].x).z());
    });
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (cell_of[i] < 0 || (node(i).lit & bits) == 0) continue;
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
      if (static_cast<double>(lit.z - z_of[i]) < 2 * options_.margin_mm + 4 * sigma) return;
      links.contradiction[i].push_back(
          {static_cast<std::uint32_t>(lit.node), static_cast<std::uint16_t>(maps_.size() + p)});
    });
  }

  const Rig& rig_;
  std::span<const int> pattern_projector_;
  std::span<const DepthMap> maps_;
  ConsistencyOptions options_;
  std::vector<Node> nodes_;
  std::vector<std::vector<std::int32_t>> id_of_;
};

/// Sum over the groups of the most believed link of each.
float tally(const std::vector<Link>& links, const std::vector<float>& belief) {
  float total = 0;
  float best = 0;
  for (std::size_t k = 0; k < links.size(); ++k) {
    if (k > 0 && links[k].group != links[k - 1].group) {
      total += best;
      best = 0;
    }
    best = std::max(best, belief[links[k].other]);
  }
  return total + best;
}

/// What the stated deviations must be multiplied with so that cameras disagree as they should: 1.48
/// times the median of the absolute normalised differences is 1 for normal errors.
double sigma_scale(const Links& links) {
  constexpr double kUsual = 1.7;  // of the rendered scenes, where one camera is all there is
  std::vector<float> ratios;
  for (const auto& of_node : links.support) {
    for (const Link& link : of_node) ratios.push_back(link.disagreement);
  }
  constexpr std::size_t kEnough = 200;
  if (ratios.size() < kEnough) return kUsual;
  return kDeviationPerMedian * static_cast<double>(upper_median(std::move(ratios)));
}

constexpr double kUnseenErrors = 1.15;  // what the cameras have in common, as a factor

void scale_sigma(double factor, std::span<DepthMap> maps) {
  for (DepthMap& map : maps) {
    for (DepthNode& node : map.nodes) node.sigma *= static_cast<float>(factor);
  }
}

/// Measured nodes next to node i of one map that continue its surface.
template <typename Visit>
void for_each_neighbor(const DepthMap& map, std::size_t i, int reach, Visit&& visit) {
  const int row = static_cast<int>(i) / map.columns;
  const int column = static_cast<int>(i) % map.columns;
  const DepthNode& n = map.nodes[i];
  for (int dr = -reach; dr <= reach; ++dr) {
    for (int dc = -reach; dc <= reach; ++dc) {
      const int r = row + dr;
      const int c = column + dc;
      if ((dr == 0 && dc == 0) || r < 0 || c < 0 || r >= map.rows || c >= map.columns) continue;
      const std::size_t j = map.index(r, c);
      const DepthNode& m = map.nodes[j];
      if (!m.measured()) continue;
      const float dx = static_cast<float>(dc * map.stride);
      const float dy = static_cast<float>(dr * map.stride);
      // Both tangent planes predict the middle.
      const float step =
          (m.w - 0.5F * (m.wx * dx + m.wy * dy)) - (n.w + 0.5F * (n.wx * dx + n.wy * dy));
      const float limit = (0.5F + 3 * (n.sigma + m.sigma)) * n.w * n.w;
      if (std::abs(step) < limit) visit(j);
    }
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

/// Lines of one projector fit a surface that is off by a whole line as well as the true one. So a
/// node that shows one projector only, and that no other camera confirms, must continue into its
/// neighbours, on nearly all sides where no labelled curve passes through it.
std::size_t drop_lone(const Comparison& comparison, std::span<DepthMap> maps) {
  constexpr int kLeastNeighbors = 3;
  constexpr int kLeastNeighborsGrown = 7;
  constexpr float kMisfit = 2.5F;
  std::vector<char> drop(comparison.nodes().size(), 0);
  parallel_chunks(drop.size(), [&](std::size_t i) {
    const Node& node = comparison.nodes()[i];
    const DepthNode& n = maps[node.map].nodes[node.index];
    if (!n.measured() || std::popcount(n.lit) > 1 || n.support > 0.01F) return;
    int neighbors = 0;
    for_each_neighbor(maps[node.map], node.index, 1, [&](std::size_t) { ++neighbors; });
    const int least = n.seeded ? kLeastNeighbors : kLeastNeighborsGrown;
    drop[i] = neighbors < least || n.misfit > kMisfit ? 1 : 0;
  });
  std::size_t dropped = 0;
  for (std::size_t i = 0; i < drop.size(); ++i) {
    if (drop[i] == 0) continue;
    DepthNode& n = maps[comparison.nodes()[i].map].nodes[comparison.nodes()[i].index];
    n.w = 0;
    n.reason = HoleReason::kOneProjector;
    ++dropped;
  }
  return dropped;
}

/// Removes `nodes` of a map: other views, or their own lines, do not bear them out.
std::size_t drop_nodes(std::span<const std::size_t> nodes, HoleReason reason, DepthMap& map) {
  for (const std::size_t k : nodes) {
    map.nodes[k].w = 0;
    map.nodes[k].reason = reason;
  }
  return nodes.size();
}

/// Patches of one projector's lines that no other camera confirms: growth that slipped by a line
/// looks the same there. They stay where labelled curves hold them and nothing speaks against them.
std::size_t drop_unconfirmed_patches(DepthMap& map) {
  constexpr double kLeastSeeded = 0.02;      // share of the nodes
  constexpr double kLeastConfidence = 0.75;  // mean
  const auto is_weak = [&](std::size_t i) {
    const DepthNode& n = map.nodes[i];
    return n.measured() && std::popcount(n.lit) <= 1 && n.support <= 0.01F;
  };
  std::size_t dropped = 0;
  std::vector<char> seen(map.nodes.size(), 0);
  std::vector<std::size_t> patch;
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    if (seen[i] || !is_weak(i)) continue;
    patch.assign(1, i);
    seen[i] = 1;
    double seeds = 0;
    double confidence = 0;
    for (std::size_t k = 0; k < patch.size(); ++k) {
      seeds += map.nodes[patch[k]].seeded ? 1 : 0;
      confidence += static_cast<double>(map.nodes[patch[k]].confidence);
      for_each_neighbor(map, patch[k], 1, [&](std::size_t j) {
        if (!seen[j] && is_weak(j)) {
          patch.push_back(j);
          seen[j] = 1;
        }
      });
    }
    const auto size = static_cast<double>(patch.size());
    if (seeds >= kLeastSeeded * size && confidence >= kLeastConfidence * size) continue;
    dropped += drop_nodes(patch, HoleReason::kOneProjector, map);
  }
  return dropped;
}

std::size_t drop_islands(const ConsistencyOptions& options, std::span<const char> supported,
                         const Comparison& comparison, std::size_t map_index, DepthMap& map) {
  std::size_t dropped = 0;
  std::vector<char> seen(map.nodes.size(), 0);
  std::vector<std::size_t> component;
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    if (seen[i] || !map.nodes[i].measured()) continue;
    component.assign(1, i);
    seen[i] = 1;
    std::size_t supports = 0;
    std::size_t seeds = 0;
    for (std::size_t k = 0; k < component.size(); ++k) {
      const std::int32_t id = comparison.id(map_index, component[k]);
      supports += supported[static_cast<std::size_t>(id)] ? 1 : 0;
      seeds += map.nodes[component[k]].seeded ? 1 : 0;
      for_each_neighbor(map, component[k], 1, [&](std::size_t j) {
        if (!seen[j]) component.push_back(j);
        seen[j] = 1;
      });
    }
    // Growth keeps to one surface: an island without a labelled curve was reached by a slip.
    const bool slipped = seeds == 0 && supports == 0;
    const bool large = component.size() >= static_cast<std::size_t>(options.min_component);
    if (!slipped && (large || 2 * supports >= component.size())) continue;
    dropped += drop_nodes(component, HoleReason::kContradicted, map);
  }
  return dropped;
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
  // w = omega . (x, y, 1); the lens changes slopes by no more than it bends lines.
  const Vec2 slope(static_cast<double>(n.wx) * camera.K(0, 0),
                   static_cast<double>(n.wy) * camera.K(1, 1));
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
  for (int round = 0; round < options.rounds; ++round) {
    parallel_chunks(count, [&](std::size_t i) {
      support[i] = tally(links.support[i], belief);
      contradiction[i] = tally(links.contradiction[i], belief);
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
  std::vector<char> supported(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Node& node = comparison.nodes()[i];
    DepthNode& n = maps[node.map].nodes[node.index];
    supported[i] = support[i] > 0.5F;
    n.confidence = belief[i];
    n.support = support[i];
    if (belief[i] >= static_cast<float>(options.min_confidence)) continue;
    n.w = 0;
    n.reason = HoleReason::kContradicted;
    ++report.contradicted;
  }
  report.sigma_scale = sigma_scale(links);
  scale_sigma(kUnseenErrors * std::clamp(report.sigma_scale, 1 / kUnseenErrors, 4.0), maps);
  report.unconfirmed = drop_lone(comparison, maps);
  for (DepthMap& map : maps) report.unconfirmed += drop_unconfirmed_patches(map);
  for (std::size_t m = 0; m < maps.size(); ++m)
    report.islands += drop_islands(options, supported, comparison, m, maps[m]);
  return report;
}

}  // namespace pencilscan
