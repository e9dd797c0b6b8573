#include "pencilscan/detection/trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "pencilscan/core/lanes.h"
#include "pencilscan/view/cell_index.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr int kCellPx = 2;  ///< of the indices: about an item each

/// What links a ridgel to the next: it lies ahead, hardly aside, and turns little.
struct LinkRule {
  float min_along;
  float max_along;
  float lateral_base;
  float lateral_slope;
  float min_cosine;
};

/// Ridgels in columns; after the last, more that never count.
struct RidgelColumns {
  std::vector<float> x, y, nx, ny;

  void add(float px, float py, float normal_x, float normal_y) {
    x.push_back(px);
    y.push_back(py);
    nx.push_back(normal_x);
    ny.push_back(normal_y);
  }
};

/// Those of eight ridgels that the rule links to one, and what a link would cost.
struct EightLinks {
  std::array<float, kLanes> cost;
  std::array<float, kLanes> forward;  ///< way along the tangent (-ny, nx)
  std::array<float, kLanes> turned;   ///< cosine between the normals; < 0: runs the other way
  std::array<int, kLanes> is_linked;
};

PENCILSCAN_INLINE void absolute(const Lanes& x, Lanes& result) { result = x < 0 ? -x : x; }

/// False if there are none.
PENCILSCAN_CLONES
bool look_at_eight(const float* x, const float* y, const float* nx, const float* ny,
                   const Ridgel& own, const LinkRule& rule, EightLinks& links) {
  Lanes dx;
  Lanes dy;
  Lanes other_nx;
  Lanes other_ny;
  load(x, dx);
  load(y, dy);
  load(nx, other_nx);
  load(ny, other_ny);
  dx -= own.x;
  dy -= own.y;
  const Lanes forward = dy * own.nx - dx * own.ny;
  Lanes along;
  absolute(forward, along);
  Lanes lateral;
  absolute(dx * own.nx + dy * own.ny, lateral);
  const Lanes turned = own.nx * other_nx + own.ny * other_ny;
  Lanes cosine;
  absolute(turned, cosine);
  const IntLanes is_linked = (along >= rule.min_along) & (along <= rule.max_along) &
                             (lateral <= rule.lateral_base + rule.lateral_slope * along) &
                             (cosine >= rule.min_cosine);
  if (!any(is_linked)) return false;
  store(along + 2 * lateral + 4 * (1 - cosine), links.cost.data());
  store(forward, links.forward.data());
  store(turned, links.turned.data());
  for (int k = 0; k < kLanes; ++k) links.is_linked[static_cast<std::size_t>(k)] = is_linked[k];
  return true;
}

/// For every end of the ridgels (2 i against the tangent of ridgel i, 2 i + 1 along it) the best
/// facing end, or -1.
std::vector<int> best_facing_ends(std::span<const Ridgel> ridgels, cv::Size size,
                                  const LinkRule& rule) {
  const CellIndex index(size, kCellPx, ridgels.size(),
                        [&](std::size_t i) { return std::pair(ridgels[i].x, ridgels[i].y); });
  RidgelColumns ordered;
  for (const int i : index.items()) {
    const Ridgel& r = ridgels[static_cast<std::size_t>(i)];
    ordered.add(r.x, r.y, r.nx, r.ny);
  }
  for (int k = 0; k < kLanes; ++k) ordered.add(0, 0, 0, 0);
  const float radius =
      std::hypot(rule.max_along, rule.lateral_base + rule.lateral_slope * rule.max_along);
  std::vector<int> best(2 * ridgels.size(), -1);
  EightLinks links;
  for (std::size_t e = 0; e < ridgels.size(); ++e) {
    std::array<float, 2> best_cost{};
    best_cost.fill(std::numeric_limits<float>::max());
    index.ranges(ridgels[e].x, ridgels[e].y, radius, [&](std::size_t begin, std::size_t end) {
      for (std::size_t first = begin; first < end; first += kLanes) {
        if (!look_at_eight(&ordered.x[first], &ordered.y[first], &ordered.nx[first],
                           &ordered.ny[first], ridgels[e], rule, links))
          continue;
        for (std::size_t k = 0; k < std::min<std::size_t>(kLanes, end - first); ++k) {
          if (links.is_linked[k] == 0) continue;
          // The end that looks back at us.
          const std::size_t side = links.forward[k] > 0 ? 1 : 0;
          const int f =
              2 * index.items()[first + k] + ((links.turned[k] > 0) == (side == 1) ? 0 : 1);
          int& known = best[2 * e + side];
          if (links.cost[k] < best_cost[side] || (links.cost[k] == best_cost[side] && f < known)) {
            best_cost[side] = links.cost[k];
            known = f;
          }
        }
      }
      return true;
    });
  }
  return best;
}

/// Keeps links on which both ends agree, and walks the chains: lists of directed items (2 i + 1:
/// walked along its own direction, 2 i: against it).
std::vector<std::vector<int>> chains_of(const std::vector<int>& best) {
  const std::size_t items = best.size() / 2;
  std::vector<int> link(best.size(), -1);
  for (std::size_t e = 0; e < best.size(); ++e) {
    const int f = best[e];
    if (f >= 0 && best[static_cast<std::size_t>(f)] == static_cast<int>(e)) link[e] = f;
  }
  std::vector<char> used(items, 0);
  std::vector<std::vector<int>> chains;
  const auto walk = [&](int exit) {
    std::vector<int> chain;
    for (int e = exit; e >= 0;) {
      const auto item = static_cast<std::size_t>(e / 2);
      if (used[item] != 0) break;
      used[item] = 1;
      chain.push_back(e);
      const int entry = link[static_cast<std::size_t>(e)];
      e = entry < 0 ? -1 : entry ^ 1;
    }
    chains.push_back(std::move(chain));
  };
  for (std::size_t e = 0; e < best.size(); ++e) {
    if (link[e] < 0 && used[e / 2] == 0) walk(static_cast<int>(e) ^ 1);
  }
  for (std::size_t i = 0; i < items; ++i) {
    if (used[i] == 0) walk(static_cast<int>(2 * i + 1));  // closed loops
  }
  return chains;
}

struct Vertex {
  Vector2f position;
  float width_px;
  float scale;
};
using Polyline = std::vector<Vertex>;

/// Adds vertices up to the next one, about 1 px apart.
void append_way(Polyline& line, const Vertex& to) {
  const Vertex from = line.back();
  const Vector2f way = to.position - from.position;
  const int missing = static_cast<int>(std::lround(way.norm())) - 1;
  for (int k = 1; k <= missing; ++k) {
    const float share = static_cast<float>(k) / static_cast<float>(missing + 1);
    line.push_back({from.position + share * way, from.width_px, from.scale});
  }
}

/// Chains of all scales as polylines.
std::vector<Polyline> chains_at_full_size(std::span<const Ridgel> ridgels, cv::Size size,
                                          const TraceOptions& options) {
  std::map<float, std::vector<Ridgel>> by_scale;
  for (const Ridgel& r : ridgels) by_scale[r.scale].push_back(r);
  std::vector<Polyline> lines;
  for (const auto& [scale, of_scale] : by_scale) {
    for (const std::vector<std::size_t>& chain : link_ridgels(of_scale, size, options)) {
      Polyline line;
      for (const std::size_t i : chain) {
        const Vertex vertex{{of_scale[i].x, of_scale[i].y}, of_scale[i].width_px, scale};
        if (scale > 1 && !line.empty()) append_way(line, vertex);
        line.push_back(vertex);
      }
      lines.push_back(std::move(line));
    }
  }
  return lines;
}

/// The end of a line.
struct End {
  Vector2f position;
  Vector2f outward;  ///< unit
  float scale;
};

Vector2f outward_at_end(const Polyline& line, bool front) {
  constexpr std::size_t kReach = 5;
  const std::size_t n = line.size();
  const float scale = (front ? line.front() : line.back()).scale;
  const std::size_t k = std::min(kReach * static_cast<std::size_t>(scale), n - 1);
  return (front ? line[0].position - line[k].position
                : line[n - 1].position - line[n - 1 - k].position)
      .normalized();
}

std::vector<Polyline> bridge_gaps(std::vector<Polyline> lines, cv::Size size, double max_gap_px) {
  // Each item is a line with two far-apart ends: index both, by end.
  std::vector<End> ends;
  for (const Polyline& line : lines) {
    ends.push_back({line.front().position, outward_at_end(line, true), line.front().scale});
    ends.push_back({line.back().position, outward_at_end(line, false), line.back().scale});
  }
  float widest = 1;
  for (const End& end : ends) widest = std::max(widest, end.scale);
  const auto lateral_limit = [](float along, float scale) { return 0.6F * scale + 0.2F * along; };
  const float farthest = static_cast<float>(max_gap_px) * widest;
  const float around = std::hypot(farthest, lateral_limit(farthest, widest));
  const CellIndex index(size, kCellPx, ends.size(), [&](std::size_t e) {
    return std::pair(ends[e].position.x(), ends[e].position.y());
  });
  std::vector<int> best(ends.size(), -1);
  for (std::size_t e = 0; e < ends.size(); ++e) {
    float best_cost = std::numeric_limits<float>::max();
    const Vector2f& here = ends[e].position;
    index.around(here.x(), here.y(), around, [&](int f) {
      if (f / 2 == static_cast<int>(e / 2)) return true;
      const End& other = ends[static_cast<std::size_t>(f)];
      const float scale = std::max(ends[e].scale, other.scale);
      const float max_gap = static_cast<float>(max_gap_px) * scale;
      const Vector2f way = other.position - ends[e].position;
      const float along = way.dot(ends[e].outward);
      const float cosine = -ends[e].outward.dot(other.outward);
      const float lateral = std::abs(way.x() * ends[e].outward.y() - way.y() * ends[e].outward.x());
      if (along < 0 || along > max_gap || cosine < 0.9F || lateral > lateral_limit(along, scale))
        return true;
      const float cost = along + 3 * lateral + 10 * (1 - cosine);
      if (cost < best_cost || (cost == best_cost && f < best[e])) {
        best_cost = cost;
        best[e] = f;
      }
      return true;
    });
  }
  std::vector<Polyline> joined;
  for (const auto& chain : chains_of(best)) {
    Polyline line;
    for (const int e : chain) {
      Polyline& part = lines[static_cast<std::size_t>(e / 2)];
      if (e % 2 == 0) std::reverse(part.begin(), part.end());
      if (!line.empty()) append_way(line, part.front());
      line.insert(line.end(), part.begin(), part.end());
    }
    joined.push_back(std::move(line));
  }
  return joined;
}

}  // namespace

std::vector<std::vector<std::size_t>> link_ridgels(std::span<const Ridgel> ridgels,
                                                   cv::Size image_size,
                                                   const TraceOptions& options) {
  if (ridgels.empty()) return {};
  const float scale = ridgels.front().scale;
  std::vector<Ridgel> own_size(ridgels.begin(), ridgels.end());
  for (Ridgel& r : own_size) {
    r.x /= scale;
    r.y /= scale;
  }
  const LinkRule rule{0.3F, 2.3F, 0.3F, 0.3F, static_cast<float>(std::cos(options.max_turn_rad))};
  const int shrink = static_cast<int>(scale);
  const cv::Size size((image_size.width + shrink - 1) / shrink,
                      (image_size.height + shrink - 1) / shrink);
  std::vector<std::vector<std::size_t>> result;
  for (const auto& chain : chains_of(best_facing_ends(own_size, size, rule))) {
    if (chain.size() < 3) continue;
    result.emplace_back();
    for (const int e : chain) result.back().push_back(static_cast<std::size_t>(e / 2));
  }
  return result;
}

std::vector<Curve> trace_curves(std::span<const Ridgel> ridgels, cv::Size image_size,
                                const TraceOptions& options) {
  std::vector<Polyline> lines = chains_at_full_size(ridgels, image_size, options);
  lines = bridge_gaps(std::move(lines), image_size, options.max_gap_px);
  std::vector<Curve> curves;
  for (const Polyline& line : lines) {
    if (static_cast<int>(line.size()) < options.min_points) continue;
    Curve curve;
    for (const Vertex& v : line) {
      CurvePoint point;
      point.position = v.position;
      point.width_px = v.width_px;
      curve.points.push_back(point);
    }
    curves.push_back(std::move(curve));
  }
  // Top to bottom, left to right: an order that does not depend on how links were walked.
  std::sort(curves.begin(), curves.end(), [](const Curve& a, const Curve& b) {
    const Vector2f& p = a.points.front().position;
    const Vector2f& q = b.points.front().position;
    return p.y() != q.y() ? p.y() < q.y() : p.x() < q.x();
  });
  return curves;
}

}  // namespace pencilscan
