#include "pencilscan/pipeline/lost_cameras.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/joint/joint.h"
#include "pencilscan/pipeline/naming_doubt.h"
#include "pencilscan/pipeline/seen_depths.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/surface/point_grid.h"

namespace pencilscan {
namespace {

/// Curves count as where they are seen within this share of what lies between two lines.
constexpr double kBesideLine = 1.0 / 6;
constexpr std::size_t kMostPoints = 1500;   // shares are known to 1.3 %
constexpr std::size_t kLeastOfFamily = 50;  // to 7 %
constexpr double kLeastCosine = 0.5;        // between where a surface faces, about, and the camera

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
    labelings.push_back(solve_joint(rig, frame.families, graphs, JointOptions{}));
  }
  return labelings;
}

/// A place of a line in space, and its colour.
struct PlaceOfLine {
  Vec3 position;
  std::size_t family = 0;
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
        points_.push_back(curve.points[i]);
        places_.push_back(
            place_of(at.cast<double>(), layers_.size() - 1, bit_of(static_cast<int>(best))));
      }
    }
  }
  /// When all layers are there.
  void sort() { grid_.emplace(places_, margin_); }
  [[nodiscard]] bool shows(const Vec2& pixel, const PlaceOfLine& place) const {
    const double x = pixel.x() + 0.5;
    const double y = pixel.y() + 0.5;
    if (!(x >= 0 && y >= 0 && x < width_ && y < height_)) return false;
    return (layers_[place.layer][index(static_cast<int>(x), static_cast<int>(y))] & place.color) !=
           0;
  }
  /// The nearest point of a curve of the place's colour within `radius` px; nullptr: none.
  [[nodiscard]] const CurvePoint* nearest(const Vec2& pixel, const PlaceOfLine& place,
                                          double radius) const {
    const CurvePoint* nearest = nullptr;
    double least = std::numeric_limits<double>::max();
    grid_->for_each_within(place_of(pixel, place.layer, place.color), radius,
                           [&](std::size_t i, double squared) {
                             if (squared >= least) return;
                             least = squared;
                             nearest = &points_[i];
                           });
    return nearest;
  }

 private:
  /// Layers and colours lie farther from each other than nearest() looks: two margins, of which
  /// margin_ is the whole number.
  [[nodiscard]] Vec3 place_of(const Vec2& pixel, std::size_t layer, std::uint8_t color) const {
    const auto set = 8 * layer + static_cast<std::size_t>(std::countr_zero(color));
    return {pixel.x(), pixel.y(), 4.0 * margin_ * static_cast<double>(set)};
  }
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
  std::vector<CurvePoint> points_;
  std::vector<Vec3> places_;
  std::optional<PointGrid> grid_;
};

/// What the other cameras measured and this one should see from about where it stands: places of
/// lines, an even share, by family.
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
      if (about_facing(rig, p).dot((center - x).normalized()) < kLeastCosine) continue;
      const int color =
          families[family].color_of_symbol(lines)[static_cast<std::size_t>(lines.symbol(p.line))];
      places.push_back({x, family, layer + family, bit_of(color)});
    }
    layer += families.size();
  }
  std::vector<PlaceOfLine> some = evenly_picked(places, kMostPoints);
  std::stable_sort(some.begin(), some.end(),
                   [](const PlaceOfLine& a, const PlaceOfLine& b) { return a.family < b.family; });
  return some;
}

/// A way of the picture, and the share of the places that show a curve of their colour then: the
/// geometric mean over the families. A picture that goes along the lines of one family still shows
/// these, and of another family, whose lines have another direction, no more than chance has it.
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
        most_roll_(options.most_roll_degrees * std::numbers::pi / 180 * camera.focal_px()) {
    for (std::size_t begin = 0, end = 0; begin < places_.size(); begin = end) {
      while (end < places_.size() && places_[end].family == places_[begin].family) ++end;
      // Of fewer a share says little.
      if (end - begin >= kLeastOfFamily) families_.emplace_back(begin, end);
    }
  }

  /// Where the camera stands, if its picture shows most of what it should there, and clearly less
  /// after any other turn.
  [[nodiscard]] std::optional<FoundCamera> found() const {
    if (families_.empty()) return std::nullopt;
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
    double elsewhere = 0;
    for (const PictureWay& way : ways) {
      if ((way.rotation_px - best.rotation_px).head<2>().norm() > kElsewhere * step_)
        elsewhere = std::max(elsewhere, way.share);
    }
    const PoseCorrection settled = settle({best.rotation_px, Vec3::Zero()});
    const double share = shown(pixels_of(settled), Vec2::Zero());
    if (share < kLeastShown || elsewhere > kMostElsewhere * share) return std::nullopt;
    return FoundCamera{0, settled, share};
  }

 private:
  /// Within a block a turn is a shift of the picture: over so many steps the difference is far
  /// below one.
  static constexpr int kBlock = 16;
  static constexpr double kElsewhere = 6;  // steps: what lies between two lines
  /// Of right ones .80 and more is shown, of pictures of other places or moments .18
  /// (experiments/knocked.py shows what comes of it).
  static constexpr double kLeastShown = 0.5;
  /// Of what the best one shows: where lines of both directions go to their neighbours, half of the
  /// colours agree. Lines of one direction alone show as much anywhere along them.
  static constexpr double kMostElsewhere = 0.75;

  static int steps(double reach, double step) { return static_cast<int>(std::ceil(reach / step)); }
  /// At the picture's edge a step.
  [[nodiscard]] double roll_step() const {
    return step_ * 4 * camera_.focal_px() / std::max(camera_.width, camera_.height);
  }

  [[nodiscard]] std::vector<std::optional<Vec2>> pixels_of(const PoseCorrection& correction) const {
    Camera moved = camera_;
    moved.device_from_world = corrected_pose(camera_, correction);
    std::vector<std::optional<Vec2>> pixels;
    for (const PlaceOfLine& place : places_) pixels.push_back(moved.project(place.position));
    return pixels;
  }

  /// Of places that are seen at these pixels, the picture shifted.
  [[nodiscard]] double shown(std::span<const std::optional<Vec2>> pixels, const Vec2& shift) const {
    double product = 1;
    for (const auto& [begin, end] : families_) {
      std::size_t count = 0;
      for (std::size_t i = begin; i < end; ++i)
        count += pixels[i] && seen_.shows(*pixels[i] + shift, places_[i]) ? 1U : 0U;
      product *= static_cast<double>(count) / static_cast<double>(end - begin);
    }
    return std::pow(product, 1 / static_cast<double>(families_.size()));
  }

  /// What half a block around a turn shows.
  [[nodiscard]] std::vector<PictureWay> ways_around(const Vec3& rotation_px) const {
    const auto pixels = pixels_of({rotation_px, Vec3::Zero()});
    std::vector<PictureWay> ways;
    for (int v = -kBlock / 2; v < kBlock / 2; ++v) {
      for (int u = -kBlock / 2; u < kBlock / 2; ++u) {
        // A turn about y moves the picture along x, one about x moves it against y.
        ways.push_back({rotation_px + Vec3(-v * step_, u * step_, 0),
                        shown(pixels, Vec2(u * step_, v * step_))});
      }
    }
    return ways;
  }

  /// The pose, near this one, at which places lie on the nearest curves of their colours (iterated
  /// closest points, Besl and McKay 1992, across the curves).
  [[nodiscard]] PoseCorrection settle(PoseCorrection correction) const {
    constexpr int kRounds = 15;
    constexpr double kFirstReach = 2;  // steps; the last one is one
    for (int round = 0; round < kRounds; ++round) {
      const double reach = step_ * (kFirstReach - (kFirstReach - 1) * round / (kRounds - 1));
      Camera moved = camera_;
      moved.device_from_world = corrected_pose(camera_, correction);
      Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
      for (const PlaceOfLine& place : places_) {
        const Vec3 x = moved.device_from_world * place.position;
        const std::optional<Vec2> pixel = moved.project(place.position);
        const CurvePoint* curve = pixel ? seen_.nearest(*pixel, place, reach) : nullptr;
        if (curve == nullptr) continue;
        const Vec2 across = curve->normal.cast<double>();
        const Eigen::Matrix<double, 1, 6> row = across.transpose() * projection_jacobian(moved, x) *
                                                pose_jacobian(camera_, correction, x);
        normal += row.transpose() * row;
        right += row.transpose() * across.dot(curve->position.cast<double>() - *pixel);
      }
      // Of turn and shift a pixel or a footprint each, as far as nothing tells them apart.
      normal.diagonal().array() += 1;
      const Eigen::Matrix<double, 6, 1> change = normal.ldlt().solve(right);
      correction.rotation_px += change.head<3>();
      correction.translation_mm += change.tail<3>();
    }
    return correction;
  }

  const Camera& camera_;
  std::vector<PlaceOfLine> places_;
  const SeenCurves& seen_;
  double step_;
  double reach_;
  double most_roll_;
  std::vector<std::pair<std::size_t, std::size_t>> families_;  ///< of the places
};

/// Those of some cameras that are found by what all others measure.
std::vector<FoundCamera> found_by_others(const Rig& rig, std::span<const FrameCurves> frames,
                                         std::span<const std::size_t> lost,
                                         const CameraSearchOptions& options) {
  const std::vector<Labeling> of_others = labels_without(rig, frames, lost);
  const double margin_px = std::max(1.0, kBesideLine * line_spacing(rig));
  std::vector<FoundCamera> found;
  for (const std::size_t c : lost) {
    SeenCurves seen(rig.cameras[c], margin_px);
    for (const FrameCurves& frame : frames) {
      for (std::size_t k = 0; k < frame.families.size(); ++k)
        seen.add_layer(frame.graphs[c], static_cast<int>(k), frame.families[k].colors.size());
    }
    seen.sort();
    const CameraSearch search(rig.cameras[c], places_of_lines(rig, frames, of_others, c), seen,
                              margin_px, options);
    if (std::optional<FoundCamera> here = search.found()) {
      here->camera = c;
      found.push_back(*here);
    }
  }
  return found;
}

}  // namespace

std::vector<PairAgreement> agreement_of_cameras(const Rig& rig, std::span<const FrameCurves> frames,
                                                std::span<const Labeling> labelings) {
  TriangulationOptions some;
  some.used_of_seven = 1;
  std::vector<PairAgreement> said(rig.cameras.size());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const ViewAgreement views(
        rig, points_by_camera(rig, triangulate(rig, frames[f].graphs, labelings[f], some)));
    for (std::size_t c = 0; c < said.size(); ++c) {
      const PairAgreement of_frame = views.with_others(c);
      said[c].same += of_frame.same;
      said[c].apart += of_frame.apart;
    }
  }
  return said;
}

std::string contradicted_camera(const Rig& rig, std::span<const FrameCurves> frames,
                                std::span<const Labeling> labelings) {
  const std::vector<PairAgreement> said = agreement_of_cameras(rig, frames, labelings);
  // A right camera beside a wrong one is contradicted too: the one with the least on its side.
  const auto least = std::min_element(
      said.begin(), said.end(),
      [](const PairAgreement& a, const PairAgreement& b) { return a.share() < b.share(); });
  return least->is_doubtful() ? rig.cameras[static_cast<std::size_t>(least - said.begin())].name
                              : std::string();
}

std::string contradiction_text(const std::string& camera) {
  return "what " + camera + " measures lies elsewhere than what the other cameras do";
}

std::vector<FoundCamera> find_lost_cameras(const Rig& rig, std::span<const FrameCurves> frames,
                                           std::span<const Labeling> labelings,
                                           const CameraSearchOptions& options) {
  const NamingDoubt doubt = naming_doubt(rig, frames, labelings);
  if (const std::vector<std::size_t> lost = doubt.cameras(); !lost.empty())
    return found_by_others(rig, frames, lost, options);
  // Of two that contradict each other either may be wrong: only the wrong one is found elsewhere.
  std::vector<FoundCamera> best;
  const std::vector<PairAgreement> said = agreement_of_cameras(rig, frames, labelings);
  for (std::size_t c = 0; c < said.size(); ++c) {
    if (!said[c].is_doubtful()) continue;
    std::vector<FoundCamera> found = found_by_others(rig, frames, {&c, 1}, options);
    if (!found.empty() && (best.empty() || found.front().share > best.front().share))
      best = std::move(found);
  }
  return best;
}

}  // namespace pencilscan
