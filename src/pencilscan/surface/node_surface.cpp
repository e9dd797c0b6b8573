#include "pencilscan/surface/node_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

constexpr double kLeastCosine = 0.15;  // of the incidence of a vertex to the camera
constexpr double kGrazing = 0.2;       // keeps grazing views from looking exact
/// What the quadric misses within its window, footprints at a right angle: relief that no sigma
/// knows.
constexpr double kRelief = 0.08;
constexpr double kNodeReach = 2.5;  // of a node's say, widths

/// A row of nodes holds what a vertex may ask: kNodeReach widths to both sides.
constexpr double kMostWidth = (kLanes - 2) / (2 * kNodeReach);

/// What the nodes of rows of one view say of a vertex, eight at once.
struct Prediction {
  std::array<float, kLanes> height;  ///< along the vertex normal
  std::array<float, kLanes> weight;  ///< 0: nothing
};

/// What the arithmetic of a row needs, of the vertex and of its pixel.
struct Place {
  float normal[3];  ///< of the vertex, camera frame
  float ray[2];     ///< of depth 1
  float ray2;       ///< its length squared
  float depth;
  float focal[2];
  float farthest;
  float inverse_width2;  ///< of the bell, nodes
  float reach2;          ///< squared, nodes
  float stride;
};

/// Values of the nodes of one row, one array each; of a node without depth w is 0.
struct NodeRow {
  const float *w, *wx, *wy, *wxx, *wxy, *wyy, *sigma;
};

/// Heights of the nodes' quadrics over a place which is `right` and `down` nodes beyond them, along
/// the place's normal, and the inverses of their variances times a bell of the distance. Returns
/// the sum of the bells.
PENCILSCAN_CLONES void predict_row(const NodeRow& row, const Place& at, float right, float down,
                                   Prediction& prediction, float& bells) {
  constexpr auto kLeastCosine2 = static_cast<float>(kGrazing * kGrazing);
  constexpr auto kRelief2 = static_cast<float>(kRelief * kRelief);
  Lanes w, wx, wy, wxx, wxy, wyy, sigma;
  load(row.w, w);
  load(row.wx, wx);
  load(row.wy, wy);
  load(row.wxx, wxx);
  load(row.wxy, wxy);
  load(row.wyy, wyy);
  load(row.sigma, sigma);
  const Lanes columns = {0, 1, 2, 3, 4, 5, 6, 7};
  const Lanes nodes = right - columns;
  const Lanes apart2 = nodes * nodes + down * down;
  const Lanes dx = nodes * at.stride;
  const float dy = down * at.stride;
  IntLanes there = (w > 0) & (apart2 <= at.reach2);
  // w = omega . (x, y, 1) over normalised pixels: the normal towards the camera is -omega.
  const Lanes x = (wx + wxx * dx + wxy * dy) * at.focal[0];
  const Lanes y = (wy + wxy * dx + wyy * dy) * at.focal[1];
  w += wx * dx + wy * dy + 0.5F * (wxx * dx * dx + wyy * dy * dy) + wxy * dx * dy;
  const Lanes z = w - x * at.ray[0] - y * at.ray[1];
  const Lanes length2 = x * x + y * y + z * z;
  // Cosine to the place's normal times the length.
  const Lanes along = -(x * at.normal[0] + y * at.normal[1] + z * at.normal[2]);
  there &= (w > 0) & (along > 0) & (along * along >= 0.25F * length2);
  // The ray meets the surface at 1 / w: omega . ray = w.
  const Lanes height = (w * at.depth - 1) / along;
  there &= (height < at.farthest) & (height > -at.farthest);
  Lanes cosine2 = w * w / (at.ray2 * length2);
  cosine2 = cosine2 > kLeastCosine2 ? cosine2 : cosine2 - cosine2 + kLeastCosine2;
  Lanes bell;
  exponential(-apart2 * at.inverse_width2, bell);
  // A window covers more of a slanted surface: its relief counts more.
  const Lanes weight = bell / (sigma * sigma * cosine2 + kRelief2 / cosine2);
  const Lanes none{};
  store(there ? height : none, prediction.height.data());
  store(there ? weight : none, prediction.weight.data());
  const Lanes counted = there ? bell : none;
  bells = 0;
  for (int k = 0; k < kLanes; ++k) bells += counted[k];
}

/// Weighted mean, reweighted against predictions of another surface or of slipped nodes.
PENCILSCAN_CLONES void agreed_height(const Prediction* predictions, std::size_t count,
                                     float inverse_robust, float& height) {
  height = 0;
  for (int round = 0; round < 3; ++round) {
    Lanes sum{};
    Lanes total{};
    for (std::size_t i = 0; i < count; ++i) {
      Lanes of_node, weight;
      load(predictions[i].height.data(), of_node);
      load(predictions[i].weight.data(), weight);
      if (round > 0) {
        const Lanes off = (of_node - height) * inverse_robust;
        const Lanes outlying = 1 + off * off;
        weight /= outlying * outlying;
      }
      sum += weight * of_node;
      total += weight;
    }
    float all = 0;
    float of_all = 0;
    for (int k = 0; k < kLanes; ++k) {
      all += total[k];
      of_all += sum[k];
    }
    height = of_all / all;
  }
}

/// One camera's nodes as a surface.
class NodeView {
 public:
  NodeView(const Rig& rig, const DepthMap& map, const FollowOptions& options)
      : camera_(&rig.cameras[static_cast<std::size_t>(map.camera)]),
        eye_(camera_->center()),
        stride_(map.stride),
        rows_(map.rows),
        width_(map.columns + 2 * kLanes),
        farthest_(options.farthest),
        reach_(kNodeReach * options.width_nodes),
        inverse_width2_(0.5 / (options.width_nodes * options.width_nodes)) {
    for (std::vector<float>& plane : planes_)
      plane.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(rows_), 0);
    for (int row = 0; row < map.rows; ++row) {
      for (int column = 0; column < map.columns; ++column) {
        const DepthNode& node = map.nodes[map.index(row, column)];
        if (!node.measured()) continue;
        const std::array<float, 7> values{node.w,   node.wx,  node.wy,   node.wxx,
                                          node.wxy, node.wyy, node.sigma};
        for (std::size_t k = 0; k < values.size(); ++k) planes_[k][index(row, column)] = values[k];
      }
    }
  }

  /// Adds what the nodes around the pixel of x say of the surface there; n: its normal, world.
  /// Returns the sum of their bells.
  float predict(const Vec3& x, const Vec3& n, std::vector<Prediction>& predictions) const {
    if ((eye_ - x).normalized().dot(n) < kLeastCosine) return 0;
    const auto pixel = camera_->project(x);
    if (!pixel || !camera_->contains(*pixel)) return 0;
    const Place place = place_of(x, n);
    const Vec2 at = *pixel / stride_;
    // In eight columns from here on there are all within reach.
    const int column = static_cast<int>(std::ceil(at[0] - reach_));
    const int first = std::max(0, static_cast<int>(std::ceil(at[1] - reach_)));
    const int last = std::min(rows_ - 1, static_cast<int>(std::floor(at[1] + reach_)));
    float bells = 0;
    for (int row = first; row <= last; ++row) {
      const std::size_t k = index(row, column);
      const NodeRow nodes{&planes_[0][k], &planes_[1][k], &planes_[2][k], &planes_[3][k],
                          &planes_[4][k], &planes_[5][k], &planes_[6][k]};
      Prediction prediction;
      float of_row = 0;
      predict_row(nodes, place, static_cast<float>(at[0] - column), static_cast<float>(at[1] - row),
                  prediction, of_row);
      if (!(of_row > 0)) continue;
      predictions.push_back(prediction);
      bells += of_row;
    }
    return bells;
  }

 private:
  /// Eight columns before the first node and after the last are empty.
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column + kLanes);
  }

  [[nodiscard]] Place place_of(const Vec3& x, const Vec3& n) const {
    const Vec3 local = camera_->device_from_world * x;
    const Vec3 ray = local / local.z();
    const Eigen::Vector3f normal = (camera_->device_from_world.rotation * n).cast<float>();
    Place at{};
    for (int k = 0; k < 3; ++k) at.normal[k] = normal[k];
    for (int k = 0; k < 2; ++k) at.ray[k] = static_cast<float>(ray[k]);
    at.ray2 = static_cast<float>(ray.squaredNorm());
    at.depth = static_cast<float>(local.z());
    at.focal[0] = static_cast<float>(camera_->K(0, 0));
    at.focal[1] = static_cast<float>(camera_->K(1, 1));
    at.farthest = static_cast<float>(farthest_);
    at.inverse_width2 = static_cast<float>(inverse_width2_);
    at.reach2 = static_cast<float>(reach_ * reach_);
    at.stride = static_cast<float>(stride_);
    return at;
  }

  const Camera* camera_;
  Vec3 eye_;
  int stride_;
  int rows_;
  int width_;  ///< nodes
  double farthest_;
  double reach_;  ///< of a node's say, nodes
  double inverse_width2_;
  std::array<std::vector<float>, 7> planes_;  ///< in the order of NodeRow
};

/// Vertices that did not move take a share of their neighbours' mean move, for a few edges.
void fade_out(const TriangleMesh& mesh, std::vector<char> moved, std::vector<Vec3>& moves) {
  constexpr int kEdges = 4;
  constexpr double kShare = 0.7;
  const auto is_moved = [&](int v) { return moved[static_cast<std::size_t>(v)] != 0; };
  std::vector<std::array<int, 3>> open;  // faces with a vertex that did not move
  for (const auto& face : mesh.faces) {
    if (!std::all_of(face.begin(), face.end(), is_moved)) open.push_back(face);
  }
  std::vector<Vec3> sum(moves.size(), Vec3::Zero());
  std::vector<int> count(moves.size(), 0);
  for (int edge = 0; edge < kEdges; ++edge) {
    std::vector<std::size_t> beside;
    for (const auto& face : open) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto a = static_cast<std::size_t>(face[k]);
        const auto b = static_cast<std::size_t>(face[(k + 1) % 3]);
        if (moved[a] || !moved[b]) continue;
        sum[a] += moves[b];
        if (count[a]++ == 0) beside.push_back(a);
      }
    }
    for (const std::size_t v : beside) {
      moves[v] = kShare / count[v] * sum[v];
      moved[v] = 1;
    }
  }
}

}  // namespace

std::vector<char> follow_nodes(const Rig& rig, std::span<const DepthMap> maps,
                               const FollowOptions& options, TriangleMesh& mesh) {
  PENCILSCAN_CHECK(options.width_nodes > 0 && options.robust > 0 && options.least_weight > 0);
  PENCILSCAN_CHECK(options.width_nodes <= kMostWidth);
  std::vector<std::optional<NodeView>> views(maps.size());
  parallel_for(maps.size(), [&](std::size_t k) { views[k].emplace(rig, maps[k], options); });
  const std::vector<Vec3> start = mesh.vertices;
  std::vector<char> moved(start.size(), 0);
  for (int round = 0; round < options.rounds; ++round) {
    const std::vector<Vec3> normals = vertex_normals(mesh);
    parallel_chunks(start.size(), [&](std::size_t v) {
      if (!(normals[v].squaredNorm() > 0.5)) return;
      thread_local std::vector<Prediction> predictions;
      predictions.clear();
      double bells = 0;
      for (const auto& view : views)
        bells += static_cast<double>(view->predict(mesh.vertices[v], normals[v], predictions));
      if (bells < options.least_weight) return;
      float height = 0;
      agreed_height(predictions.data(), predictions.size(), static_cast<float>(1 / options.robust),
                    height);
      mesh.vertices[v] += static_cast<double>(height) * normals[v];
      moved[v] = 1;
    });
  }
  std::vector<Vec3> moves(start.size());
  for (std::size_t v = 0; v < start.size(); ++v) moves[v] = mesh.vertices[v] - start[v];
  fade_out(mesh, moved, moves);
  for (std::size_t v = 0; v < start.size(); ++v) mesh.vertices[v] = start[v] + moves[v];
  return moved;
}

}  // namespace pencilscan
