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
  std::array<float, kLanes> height;    ///< along the vertex normal
  std::array<float, kLanes> bell;      ///< over the distance in the image; 0: nothing
  std::array<float, kLanes> variance;  ///< of the height, > 0
  std::array<float, kLanes> bend2;     ///< height of the cubic bend that its normal shows, squared
  std::array<float, kLanes> weight;    ///< 0: nothing
};

/// Where a view's nodes stand around a pixel: sums of their bells, of those times the ways to them,
/// and times the ways squared; nodes.
struct Stand {
  float bells = 0;
  float right = 0;
  float down = 0;
  float apart2 = 0;

  /// 0: on all sides alike; 1: all at one place beside the pixel.
  [[nodiscard]] float one_sided() const {
    return apart2 > 0 ? (right * right + down * down) / (bells * apart2) : 0;
  }
};

/// What the arithmetic of a row needs, of the vertex and of its pixel.
struct Place {
  float normal[3];  ///< of the vertex, camera frame
  float ray[2];     ///< of depth 1
  float ray2;       ///< its length squared
  float depth;
  float slope[2][2];    ///< pixels by normalised coordinates
  float inverse[2][2];  ///< of slope
  float farthest;
  float inverse_width2;  ///< of the bell, nodes
  float reach2;          ///< squared, nodes
  float stride;
};

/// Values of the nodes of one row, one array each; of a node without depth w is 0.
struct NodeRow {
  const float *w, *wx, *wy, *wxx, *wxy, *wyy, *sigma;
};

/// Heights of the nodes' surfaces over a place which is `right` and `down` nodes beyond them, along
/// the place's normal. A node's surface is the paraboloid over its tangent plane that has the
/// curvature of its quadric of inverse depth there: carried on towards an outline, that quadric
/// itself turns away less than a ball does.
PENCILSCAN_CLONES void predict_row(const NodeRow& row, const Place& at, float right, float down,
                                   Prediction& prediction, Stand& stand) {
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
  // At the node: omega . (x, y, 1) = w over normalised pixels, and -omega is normal to the surface.
  const Lanes away_x = at.inverse[0][0] * dx + at.inverse[0][1] * dy;
  const Lanes away_y = at.inverse[1][0] * dx + at.inverse[1][1] * dy;
  const Lanes x0 = at.ray[0] - away_x;
  const Lanes y0 = at.ray[1] - away_y;
  const Lanes gx = at.slope[0][0] * wx + at.slope[1][0] * wy;
  const Lanes gy = at.slope[0][1] * wx + at.slope[1][1] * wy;
  const Lanes gz = w - x0 * gx - y0 * gy;
  const Lanes inverse2 = 1 / (gx * gx + gy * gy + gz * gz);
  // The way from the node to the place, and its part along the tangent plane.
  const Lanes depth = 1 / w;
  const Lanes beyond = at.depth - depth;
  const Lanes from_x = at.ray[0] * beyond + depth * away_x;
  const Lanes from_y = at.ray[1] * beyond + depth * away_y;
  const Lanes off = gx * from_x + gy * from_y + gz * beyond;
  const Lanes lift = off * inverse2;
  const Lanes along_z = beyond - lift * gz;
  const Lanes qx = from_x - lift * gx - x0 * along_z;
  const Lanes qy = from_y - lift * gy - y0 * along_z;
  const Lanes px = at.slope[0][0] * qx + at.slope[0][1] * qy;
  const Lanes py = at.slope[1][0] * qx + at.slope[1][1] * qy;
  const Lanes bend_x = wxx * px + wxy * py;
  const Lanes bend_y = wxy * px + wyy * py;
  const Lanes hx = w * (at.slope[0][0] * bend_x + at.slope[1][0] * bend_y);
  const Lanes hy = w * (at.slope[0][1] * bend_x + at.slope[1][1] * bend_y);
  const Lanes hz = -(x0 * hx + y0 * hy);
  const Lanes turn = (gx * hx + gy * hy + gz * hz) * inverse2;
  const Lanes x = gx + hx - turn * gx;
  const Lanes y = gy + hy - turn * gy;
  const Lanes z = gz + hz - turn * gz;
  const Lanes length2 = x * x + y * y + z * z;
  // Cosine to the place's normal times the length.
  const Lanes along = -(x * at.normal[0] + y * at.normal[1] + z * at.normal[2]);
  there &= (along > 0) & (along * along >= 0.25F * length2);
  const Lanes height = (off + 0.5F * (hx * qx + hy * qy)) / along;
  const Lanes toward = x * at.ray[0] + y * at.ray[1] + z;
  there &= (height < at.farthest) & (height > -at.farthest);
  Lanes cosine2 = toward * toward / (at.ray2 * length2);
  cosine2 = cosine2 > kLeastCosine2 ? cosine2 : cosine2 - cosine2 + kLeastCosine2;
  Lanes bell;
  exponential(-apart2 * at.inverse_width2, bell);
  // A window covers more of a slanted surface: its relief counts more.
  const Lanes variance = sigma * sigma * cosine2 + kRelief2 / cosine2;
  // A cubic bend that the paraboloid lacks is a third of its own slope times the way.
  const Lanes way2 = from_x * from_x + from_y * from_y + beyond * beyond - off * lift;
  const Lanes bend2 = way2 * (length2 / (along * along) - 1) / 9;
  const Lanes none{};
  const Lanes counted = there ? bell : none;
  store(there ? height : none, prediction.height.data());
  store(counted, prediction.bell.data());
  store(there ? variance : none + 1, prediction.variance.data());
  store(there ? bend2 : none, prediction.bend2.data());
  const Lanes to_right = counted * nodes;
  const Lanes to_all = counted * apart2;
  stand = {};
  for (int k = 0; k < kLanes; ++k) {
    stand.bells += counted[k];
    stand.right += to_right[k];
    stand.apart2 += to_all[k];
  }
  stand.down = stand.bells * down;
}

/// Weights of a view's predictions. Cubic bends of nodes on opposite sides cancel, those of nodes
/// on one side do not.
PENCILSCAN_CLONES void weigh(Prediction* predictions, std::size_t count, float one_sided) {
  for (std::size_t i = 0; i < count; ++i) {
    Lanes bell, variance, bend2;
    load(predictions[i].bell.data(), bell);
    load(predictions[i].variance.data(), variance);
    load(predictions[i].bend2.data(), bend2);
    store(bell / (variance + one_sided * bend2), predictions[i].weight.data());
  }
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
    const std::size_t before = predictions.size();
    Stand stand;
    for (int row = first; row <= last; ++row) {
      const std::size_t k = index(row, column);
      const NodeRow nodes{&planes_[0][k], &planes_[1][k], &planes_[2][k], &planes_[3][k],
                          &planes_[4][k], &planes_[5][k], &planes_[6][k]};
      Prediction prediction;
      Stand of_row;
      predict_row(nodes, place, static_cast<float>(at[0] - column), static_cast<float>(at[1] - row),
                  prediction, of_row);
      if (!(of_row.bells > 0)) continue;
      predictions.push_back(prediction);
      stand.bells += of_row.bells;
      stand.right += of_row.right;
      stand.down += of_row.down;
      stand.apart2 += of_row.apart2;
    }
    weigh(predictions.data() + before, predictions.size() - before, stand.one_sided());
    return stand.bells;
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
    const Eigen::Matrix2d slope = camera_->pixel_slope(ray.head<2>());
    const Eigen::Matrix2d inverse = slope.inverse();
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < 2; ++column) {
        at.slope[row][column] = static_cast<float>(slope(row, column));
        at.inverse[row][column] = static_cast<float>(inverse(row, column));
      }
    }
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
