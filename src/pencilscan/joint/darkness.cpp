#include "pencilscan/joint/darkness.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/parallel.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// Nothing within so many line spacings is darkness: lines lie farther apart only where the surface
/// turns away from camera or projector.
constexpr double kDarkSpacings = 2;

constexpr char kOut = 0;  ///< not in that picture
constexpr char kLit = 1;
constexpr char kDark = 2;

}  // namespace

Darkness::Darkness(const Rig& rig, std::span<const GridGraph> graphs,
                   std::span<const LabelledPieces> pieces)
    : rig_(rig), graphs_(graphs), pieces_(pieces), seen_(graphs.size()) {
  for (const GridGraph& graph : graphs) views_.push_back(make_view(rig, graph));
  parallel_for(graphs.size(), [&](std::size_t g) { seen_[g] = look_from_others(g); });
  weigh_views();
}

Darkness::View Darkness::make_view(const Rig& rig, const GridGraph& graph) {
  View view;
  if (graph.curves.empty()) return view;
  const Camera& camera = rig.camera(graph.camera);
  const double distance = (camera.center() - working_volume(rig).center).norm();
  const double px_per_length = std::sqrt(camera.K(0, 0) * camera.K(1, 1)) / distance;
  view.cell_px =
      static_cast<float>(std::max(1.0, kDarkSpacings * line_spacing(rig) * px_per_length));
  // One cell more on each side.
  const auto cells = [&](int pixels) {
    return static_cast<int>(static_cast<float>(pixels) / view.cell_px) + 3;
  };
  view.columns = cells(camera.width);
  view.is_lit.assign(
      static_cast<std::size_t>(view.columns) * static_cast<std::size_t>(cells(camera.height)), 0);
  for (const Curve& curve : graph.curves) {
    for (const CurvePoint& point : curve.points) {
      const int x = static_cast<int>(point.position.x() / view.cell_px);
      const int y = static_cast<int>(point.position.y() / view.cell_px);
      for (int row = y; row < y + 3; ++row)
        for (int column = x; column < x + 3; ++column)
          view.is_lit[static_cast<std::size_t>(row * view.columns + column)] = 1;
    }
  }
  return view;
}

std::vector<char> Darkness::look_from_others(std::size_t g) const {
  const LabelledPieces& own = pieces_[g];
  const RigidTransform world_from_camera =
      rig_.camera(graphs_[g].camera).device_from_world.inverse();
  std::vector<char> seen;
  for (std::size_t p = 0; p < own.labels.size(); ++p) {
    const Eigen::Vector3f ray = own.graph.pieces[p].middle.homogeneous();
    for (const PieceLabel& label : own.labels[p]) {
      const Vec3 place = world_from_camera * (ray / label.q.dot(ray)).cast<double>().eval();
      for (std::size_t o = 0; o < views_.size(); ++o) {
        const View& view = views_[o];
        char& is = seen.emplace_back(kOut);
        if (o == g || view.is_lit.empty()) continue;
        const Camera& other = rig_.camera(graphs_[o].camera);
        const auto pixel = other.project(place);
        if (!pixel || !other.contains(*pixel)) continue;
        const int x = static_cast<int>(static_cast<float>(pixel->x()) / view.cell_px) + 1;
        const int y = static_cast<int>(static_cast<float>(pixel->y()) / view.cell_px) + 1;
        is = view.is_lit[static_cast<std::size_t>(y * view.columns + x)] != 0 ? kLit : kDark;
      }
    }
  }
  return seen;
}

void Darkness::weigh_views() {
  struct Count {
    double seen = 0;
    double dark = 0;
    /// Laplace's rule: what was never seen may be.
    [[nodiscard]] double share() const { return (dark + 1) / (seen + 2); }
  };
  std::vector<Count> best(views_.size());
  std::vector<Count> all(views_.size());
  for (std::size_t g = 0; g < pieces_.size(); ++g) {
    const std::vector<char> is_crossed = crossed_pieces(pieces_[g].graph);
    const char* seen = seen_[g].data();
    for (std::size_t p = 0; p < pieces_[g].labels.size(); ++p) {
      const std::vector<float>& scores = pieces_[g].scores[p];
      const auto winner = std::min_element(scores.begin(), scores.end()) - scores.begin();
      for (std::ptrdiff_t k = 0; k < std::ssize(scores); ++k, seen += views_.size()) {
        if (is_crossed[p] == 0) continue;
        for (std::size_t o = 0; o < views_.size(); ++o) {
          if (seen[o] == kOut) continue;
          for (Count* count : {&all[o], &best[o]}) {
            if (count == &best[o] && k != winner) continue;
            count->seen += 1;
            count->dark += seen[o] == kDark ? 1 : 0;
          }
        }
      }
    }
  }
  for (std::size_t o = 0; o < views_.size(); ++o)
    views_[o].cost = static_cast<float>(std::max(0.0, std::log(all[o].share() / best[o].share())));
}

std::vector<std::vector<float>> Darkness::costs(std::size_t g) const {
  std::vector<std::vector<float>> result;
  const char* seen = seen_[g].data();
  for (const auto& labels : pieces_[g].labels) {
    for (float& cost : result.emplace_back(labels.size(), 0.F)) {
      for (std::size_t o = 0; o < views_.size(); ++o)
        if (seen[o] == kDark) cost = std::max(cost, views_[o].cost);
      seen += views_.size();
    }
  }
  return result;
}

}  // namespace pencilscan
