#include "pencilscan/pipeline/lost_cameras.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/joint/joint.h"
#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

/// Curves count as where they are seen within this share of what lies between two lines.
constexpr double kBesideLine = 1.0 / 6;
constexpr std::size_t kMostPoints = 1500;  // shares are known to 1.3 %
constexpr std::size_t kLeastPoints = 100;  // to 5 %
constexpr double kLeastCosine = 0.5;       // between where a surface faces, about, and the camera

std::vector<Labeling> labels_without(const Rig& rig, std::span<const FrameCurves> frames,
                                     std::span<const std::size_t> cameras) {
  std::vector<Labeling> labelings;
  for (const FrameCurves& frame : frames) {
    std::vector<GridGraph> graphs = frame.graphs;
    for (GridGraph& graph : graphs) {
      const auto c = static_cast<std::size_t>(graph.camera);
      if (std::find(cameras.begin(), cameras.end(), c) == cameras.end()) continue;
      GridGraph none;
      none.camera = graph.camera;
      graph = std::move(none);
    }
    labelings.push_back(solve_joint(rig, frame.families, graphs));
  }
  return labelings;
}

/// A place of a line in space, and its colour.
struct PlaceOfLine {
  Vec3 position;
  std::size_t layer = 0;   ///< of the pictures: frame and family
  std::uint8_t color = 0;  ///< a bit
};

std::uint8_t bit_of(int color) { return static_cast<std::uint8_t>(1U << (color % 8)); }

/// Where a camera sees curves of which colours, with a margin.
class SeenCurves {
 public:
  SeenCurves(const Camera& camera, double margin_px)
      : width_(camera.width), height_(camera.height), margin_(static_cast<int>(margin_px)) {}

  void add_layer(const GridGraph& graph, int family, std::size_t colors) {
    std::vector<std::uint8_t>& layer =
        layers_.emplace_back(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    for (const Curve& curve : graph.curves) {
      if (curve.family != family) continue;
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const float* code = curve.code.data() + i * colors;
        const auto best = std::max_element(code, code + colors) - code;
        const Eigen::Vector2f at = curve.points[i].position;
        paint(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())),
              bit_of(static_cast<int>(best)), layer);
      }
    }
  }
  [[nodiscard]] bool shows(const Vec2& pixel, const PlaceOfLine& place) const {
    const double x = pixel.x() + 0.5;
    const double y = pixel.y() + 0.5;
    if (!(x >= 0 && y >= 0 && x < width_ && y < height_)) return false;
    return (layers_[place.layer][index(static_cast<int>(x), static_cast<int>(y))] & place.color) !=
           0;
  }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  void paint(int x, int y, std::uint8_t bit, std::vector<std::uint8_t>& layer) const {
    for (int v = std::max(0, y - margin_); v <= std::min(height_ - 1, y + margin_); ++v) {
      for (int u = std::max(0, x - margin_); u <= std::min(width_ - 1, x + margin_); ++u)
        layer[index(u, v)] |= bit;
    }
  }

  int width_;
  int height_;
  int margin_;
  std::vector<std::vector<std::uint8_t>> layers_;
};

/// What the other cameras measured and this one should see from about where it stands: places of
/// lines, an even share.
std::vector<PlaceOfLine> places_of_lines(const Rig& rig, std::span<const FrameCurves> frames,
                                         std::span<const Labeling> labelings, std::size_t camera) {
  const Vec3 center = rig.cameras[camera].center();
  TriangulationOptions options;
  options.used_of_seven = 1;
  std::vector<PlaceOfLine> places;
  std::size_t layer = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const std::vector<ColorFamily>& families = frames[f].families;
    for (const MeasuredPoint& p : triangulate(rig, frames[f].graphs, labelings[f], options)) {
      const PatternRef ref{p.projector, p.pattern};
      const auto family = static_cast<std::size_t>(family_of(families, ref));
      const LinePattern& lines = rig.projectors[p.projector].patterns[p.pattern];
      const Vec3 x = position_of(p);
      // A surface that one device sees and another one lights faces about the middle of them.
      const Vec3 facing = (rig.cameras[p.camera].center() - x).normalized() +
                          (rig.projectors[p.projector].center() - x).normalized();
      if (facing.normalized().dot((center - x).normalized()) < kLeastCosine) continue;
      const int color =
          families[family].color_of_symbol(lines)[static_cast<std::size_t>(lines.symbol(p.line))];
      places.push_back({x, layer + family, bit_of(color)});
    }
    layer += families.size();
  }
  if (places.size() <= kMostPoints) return places;
  std::vector<PlaceOfLine> some;
  for (std::size_t i = 0; i < kMostPoints; ++i)
    some.push_back(places[i * places.size() / kMostPoints]);
  return some;
}

/// A way of the picture, and the share of the places that show a curve of their colour then.
struct PictureWay {
  Vec3 rotation_px = Vec3::Zero();
  double share = 0;
};

class CameraSearch {
 public:
  CameraSearch(const Camera& camera, std::vector<PlaceOfLine> places, const SeenCurves& seen,
               double step_px, const CameraSearchOptions& options)
      : camera_(camera),
        places_(std::move(places)),
        seen_(seen),
        step_(step_px),
        reach_(options.reach * std::max(camera.width, camera.height)),
        most_roll_(options.most_roll_degrees * std::numbers::pi / 180 * camera.focal_px()) {}

  /// The way that shows most, if none elsewhere shows nearly as much.
  [[nodiscard]] std::optional<Vec3> found() const {
    std::vector<Vec3> starts;
    const int rolls = steps(most_roll_, roll_step());
    const int turns = steps(reach_, kBlock * step_);
    for (int z = -rolls; z <= rolls; ++z)
      for (int y = -turns; y <= turns; ++y)
        for (int x = -turns; x <= turns; ++x)
          starts.emplace_back(kBlock * step_ * x, kBlock * step_ * y, roll_step() * z);
    std::vector<std::vector<PictureWay>> of_block(starts.size());
    parallel_for(starts.size(), [&](std::size_t i) { of_block[i] = ways_around(starts[i]); });
    std::vector<PictureWay> ways;
    for (const auto& block : of_block) ways.insert(ways.end(), block.begin(), block.end());
    const auto more = [](const PictureWay& a, const PictureWay& b) { return a.share < b.share; };
    const PictureWay best = *std::max_element(ways.begin(), ways.end(), more);
    std::vector<double> shares;
    double elsewhere = 0;
    for (const PictureWay& way : ways) {
      shares.push_back(way.share);
      if ((way.rotation_px - best.rotation_px).head<2>().norm() > kElsewhere * step_)
        elsewhere = std::max(elsewhere, way.share);
    }
    const double chance = upper_median(std::move(shares));
    if (getenv("LOST") != nullptr)
      fprintf(stderr,
              "%zu places, %zu ways: best %.3f at %.1f %.1f %.1f, elsewhere %.3f, chance %.3f\n",
              places_.size(), ways.size(), best.share, best.rotation_px.x(), best.rotation_px.y(),
              best.rotation_px.z(), elsewhere, chance);
    // Right ones have ..
    if (best.share - chance < 2 * (elsewhere - chance)) return std::nullopt;
    return best.rotation_px;
  }

 private:
  /// Within a block a turn is a shift of the picture: over so many steps the difference is far
  /// below one.
  static constexpr int kBlock = 16;
  static constexpr double kElsewhere = 6;  // steps: what lies between two lines

  static int steps(double reach, double step) { return static_cast<int>(std::ceil(reach / step)); }
  /// At the picture's edge a step.
  [[nodiscard]] double roll_step() const {
    return step_ * 4 * camera_.focal_px() / std::max(camera_.width, camera_.height);
  }

  /// Shows what lies half a block around a turn.
  [[nodiscard]] std::vector<PictureWay> ways_around(const Vec3& rotation_px) const {
    Camera turned = camera_;
    turned.device_from_world = corrected_pose(camera_, {rotation_px, Vec3::Zero()});
    std::vector<std::optional<Vec2>> pixels;
    for (const PlaceOfLine& place : places_) pixels.push_back(turned.project(place.position));
    std::vector<PictureWay> ways;
    for (int v = -kBlock / 2; v < kBlock / 2; ++v) {
      for (int u = -kBlock / 2; u < kBlock / 2; ++u) {
        // A turn about y moves the picture along x, one about x moves it against y.
        PictureWay way{rotation_px + Vec3(-v * step_, u * step_, 0), 0};
        std::size_t shown = 0;
        const Vec2 shift(u * step_, v * step_);
        for (std::size_t i = 0; i < places_.size(); ++i)
          shown += pixels[i] && seen_.shows(*pixels[i] + shift, places_[i]) ? 1U : 0U;
        way.share = static_cast<double>(shown) / static_cast<double>(places_.size());
        ways.push_back(way);
      }
    }
    return ways;
  }

  const Camera& camera_;
  std::vector<PlaceOfLine> places_;
  const SeenCurves& seen_;
  double step_;
  double reach_;
  double most_roll_;
};

}  // namespace

std::vector<FoundCamera> find_lost_cameras(const Rig& rig, std::span<const FrameCurves> frames,
                                           std::span<const Labeling> labelings,
                                           const CameraSearchOptions& options) {
  NamingDoubt doubt(rig);
  for (std::size_t f = 0; f < frames.size(); ++f)
    doubt.add(frames[f].families, frames[f].graphs, labelings[f]);
  const std::vector<std::size_t> lost = doubt.cameras();
  if (lost.empty()) return {};
  const std::vector<Labeling> of_others = labels_without(rig, frames, lost);
  const double margin_px = std::max(1.0, kBesideLine * line_spacing(rig));
  std::vector<FoundCamera> found;
  for (const std::size_t c : lost) {
    std::vector<PlaceOfLine> places = places_of_lines(rig, frames, of_others, c);
    if (places.size() < kLeastPoints) continue;
    SeenCurves seen(rig.cameras[c], margin_px);
    for (const FrameCurves& frame : frames) {
      for (std::size_t k = 0; k < frame.families.size(); ++k)
        seen.add_layer(frame.graphs[c], static_cast<int>(k), frame.families[k].colors.size());
    }
    const CameraSearch search(rig.cameras[c], std::move(places), seen, margin_px, options);
    if (const auto rotation_px = search.found()) found.push_back({c, {*rotation_px, Vec3::Zero()}});
  }
  return found;
}

}  // namespace pencilscan
