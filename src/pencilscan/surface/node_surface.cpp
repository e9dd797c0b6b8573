#include "pencilscan/surface/node_surface.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"

namespace pencilscan {
namespace {

constexpr double kLeastCosine = 0.15;  // of the incidence of a vertex to the camera
constexpr double kGrazing = 0.2;       // keeps grazing views from looking exact
/// What the quadric misses within its window, footprints at a right angle: relief that no sigma
/// knows.
constexpr double kRelief = 0.08;
constexpr double kReach = 2.5;  // of a node's say, widths

double square(double x) { return x * x; }

struct Prediction {
  double height = 0;  ///< along the vertex normal
  double weight = 0;
  double bell = 0;
};

/// One camera's nodes as a surface.
class NodeView {
 public:
  NodeView(const Rig& rig, const DepthMap& map, const FollowOptions& options)
      : camera_(&rig.cameras[static_cast<std::size_t>(map.camera)]),
        eye_(camera_->center()),
        map_(&map),
        farthest_(options.farthest),
        fx_(camera_->K(0, 0)),
        fy_(camera_->K(1, 1)),
        inverse_width2_(0.5 / (options.width_nodes * options.width_nodes)),
        reach2_(kReach * kReach * options.width_nodes * options.width_nodes),
        reach_(static_cast<int>(std::ceil(kReach * options.width_nodes))) {}

  /// What the nodes around the pixel of x say of the surface there; n: its normal, world.
  void predict(const Vec3& x, const Vec3& n, std::vector<Prediction>& predictions) const {
    if ((eye_ - x).normalized().dot(n) < kLeastCosine) return;
    const auto pixel = camera_->project(x);
    if (!pixel || !camera_->contains(*pixel)) return;
    const Place place(*camera_, x, n);
    const Vec2 at = *pixel / map_->stride;
    const int row0 = static_cast<int>(std::lround(at[1]));
    const int column0 = static_cast<int>(std::lround(at[0]));
    const int first_column = std::max(0, column0 - reach_);
    const int last_column = std::min(map_->columns - 1, column0 + reach_);
    // The bell over the image is the product of one across and one along.
    thread_local std::vector<double> across;
    across.clear();
    for (int column = first_column; column <= last_column; ++column)
      across.push_back(std::exp(-square(at[0] - column) * inverse_width2_));
    for (int row = std::max(0, row0 - reach_); row <= std::min(map_->rows - 1, row0 + reach_);
         ++row) {
      const double bell_of_row = std::exp(-square(at[1] - row) * inverse_width2_);
      for (int column = first_column; column <= last_column; ++column) {
        const double right = at[0] - column;
        const double down = at[1] - row;
        const double apart2 = right * right + down * down;
        if (apart2 > reach2_) continue;
        const DepthNode& node = map_->nodes[map_->index(row, column)];
        if (!node.measured()) continue;
        const auto height = node_height(node, right * map_->stride, down * map_->stride, place);
        if (!height) continue;
        const double bell = bell_of_row * across[static_cast<std::size_t>(column - first_column)];
        predictions.push_back({height->first, bell * height->second, bell});
      }
    }
  }

 private:
  /// A point and its normal in the camera's frame.
  struct Place {
    Place(const Camera& camera, const Vec3& x, const Vec3& n)
        : normal(camera.device_from_world.rotation * n) {
      const Vec3 local = camera.device_from_world * x;
      depth = local.z();
      ray = local / depth;
      ray_length = ray.norm();
    }
    Vec3 normal;
    Vec3 ray;  ///< of depth 1
    double depth, ray_length;
  };

  /// Height of the node's quadric over a place whose pixel is (dx, dy) beyond the node, along the
  /// place's normal, and the inverse of its variance. In scalars: vectors made of them stall.
  [[nodiscard]] std::optional<std::pair<double, double>> node_height(const DepthNode& node,
                                                                     double dx, double dy,
                                                                     const Place& at) const {
    const double wxx = node.wxx, wxy = node.wxy, wyy = node.wyy;
    const double wx = node.wx, wy = node.wy;
    const double w =
        node.w + wx * dx + wy * dy + 0.5 * (wxx * dx * dx + wyy * dy * dy) + wxy * dx * dy;
    if (!(w > 0)) return std::nullopt;
    // w = omega . (x, y, 1) over normalised pixels: the normal towards the camera is -omega.
    const double x = (wx + wxx * dx + wxy * dy) * fx_;
    const double y = (wy + wxy * dx + wyy * dy) * fy_;
    const double z = w - x * at.ray.x() - y * at.ray.y();
    const double length = std::sqrt(x * x + y * y + z * z);
    // Cosine to the place's normal times the length.
    const double along = -(x * at.normal.x() + y * at.normal.y() + z * at.normal.z());
    if (along < 0.5 * length) return std::nullopt;
    // The ray meets the surface at 1 / w: omega . ray = w.
    const double height = (w * at.depth - 1) / along;
    if (!(std::abs(height) < farthest_)) return std::nullopt;
    const double cosine = std::max(w / (at.ray_length * length), kGrazing);
    const double sigma = static_cast<double>(node.sigma) * cosine;
    const double relief = kRelief / cosine;  // a window covers more of a slanted surface
    return std::pair(height, 1 / (sigma * sigma + relief * relief));
  }

  const Camera* camera_;
  Vec3 eye_;
  const DepthMap* map_;
  double farthest_;
  double fx_, fy_;
  double inverse_width2_;
  double reach2_;  ///< squared, nodes
  int reach_;
};

/// Weighted mean, reweighted against predictions of another surface or of slipped nodes.
std::optional<double> agreed_height(std::span<const Prediction> predictions,
                                    const FollowOptions& options) {
  double bells = 0;
  for (const Prediction& p : predictions) bells += p.bell;
  if (bells < options.least_weight) return std::nullopt;
  double height = 0;
  for (int round = 0; round < 3; ++round) {
    double sum = 0;
    double total = 0;
    for (const Prediction& p : predictions) {
      const double off = (p.height - height) / options.robust;
      const double outlying = round == 0 ? 1 : 1 + off * off;
      const double weight = p.weight / (outlying * outlying);
      sum += weight * p.height;
      total += weight;
    }
    height = sum / total;
  }
  return height;
}

/// Vertices that did not move take a share of their neighbours' mean move, for a few edges.
void fade_out(const TriangleMesh& mesh, std::vector<char> moved, std::vector<Vec3>& moves) {
  constexpr int kEdges = 4;
  constexpr double kShare = 0.7;
  std::vector<Vec3> sum(moves.size());
  std::vector<int> count(moves.size());
  for (int edge = 0; edge < kEdges; ++edge) {
    std::fill(sum.begin(), sum.end(), Vec3::Zero());
    std::fill(count.begin(), count.end(), 0);
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto a = static_cast<std::size_t>(face[k]);
        const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
        if (moved[a] || !moved[b]) continue;
        sum[a] += moves[b];
        ++count[a];
      }
    }
    for (std::size_t v = 0; v < moves.size(); ++v) {
      if (count[v] == 0) continue;
      moves[v] = kShare / count[v] * sum[v];
      moved[v] = 1;
    }
  }
}

}  // namespace

void follow_nodes(const Rig& rig, std::span<const DepthMap> maps, const FollowOptions& options,
                  TriangleMesh& mesh) {
  PENCILSCAN_CHECK(options.width_nodes > 0 && options.robust > 0 && options.least_weight > 0);
  std::vector<NodeView> views;
  for (const DepthMap& map : maps) views.emplace_back(rig, map, options);
  const std::vector<Vec3> start = mesh.vertices;
  std::vector<char> moved(start.size(), 0);
  for (int round = 0; round < options.rounds; ++round) {
    const std::vector<Vec3> normals = vertex_normals(mesh);
    parallel_chunks(start.size(), [&](std::size_t v) {
      if (!(normals[v].squaredNorm() > 0.5)) return;
      thread_local std::vector<Prediction> predictions;
      predictions.clear();
      for (const NodeView& view : views) view.predict(mesh.vertices[v], normals[v], predictions);
      const auto height = agreed_height(predictions, options);
      if (!height) return;
      mesh.vertices[v] += *height * normals[v];
      moved[v] = 1;
    });
  }
  std::vector<Vec3> moves(start.size());
  for (std::size_t v = 0; v < start.size(); ++v) moves[v] = mesh.vertices[v] - start[v];
  fade_out(mesh, moved, moves);
  for (std::size_t v = 0; v < start.size(); ++v) mesh.vertices[v] = start[v] + moves[v];
}

}  // namespace pencilscan
