#include "pencilscan/pipeline/found_floor.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pencilscan/core/median.h"
#include "pencilscan/core/random.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

// Line spacings. A place is on a plane that is nearer than two and a half times what a floor
// deviates from its plane (joint/floor_cost.cpp); the object is what ObjectSpace leaves to it.
constexpr double kOn = 0.25;
constexpr double kClear = 1;

/// How places lie about a plane; sums of weights.
struct Sides {
  double on = 0;                ///< in the volume and outside
  double above = 0, below = 0;  ///< in the volume
};

class Search {
 public:
  Search(const Rig& rig, std::span<const NamedPlace> places)
      : rig_(rig), volume_(working_volume(rig)), spacing_(line_spacing(rig)) {
    // What lies farther off is a wall; its wrong names are everywhere.
    constexpr double kNear = 3;  // radii
    for (const NamedPlace& place : places)
      if ((place.x - volume_.center).norm() < kNear * volume_.radius) places_.push_back(place);
  }

  [[nodiscard]] std::optional<FoundFloor> find() const {
    constexpr std::size_t kEnough = 300;  // places: some tens of lines
    if (places_.size() < kEnough || rig_.cameras.empty()) return std::nullopt;
    std::optional<Floor> plane = most_common();
    if (!plane) return std::nullopt;
    constexpr int kRounds = 5;
    for (int round = 0; round < kRounds && plane; ++round) plane = fitted(*plane);
    if (!plane || !may_be_floor(*plane)) return std::nullopt;
    return judged(*plane);
  }

 private:
  [[nodiscard]] bool is_in_volume(const Vec3& x) const {
    return (x - volume_.center).norm() < volume_.radius;
  }

  /// True where all devices look down on it, and it passes through the volume below its centre.
  [[nodiscard]] bool may_be_floor(const Floor& plane) const {
    const double height = plane.height(volume_.center);
    if (!(height > 0) || height > volume_.radius) return false;
    const auto is_above = [&](const Device& device) {
      return plane.height(device.center()) > volume_.radius - height;
    };
    return std::all_of(rig_.cameras.begin(), rig_.cameras.end(), is_above) &&
           std::all_of(rig_.projectors.begin(), rig_.projectors.end(), is_above);
  }

  /// The plane through three places that most others lie on.
  [[nodiscard]] std::optional<Floor> most_common() const {
    constexpr int kDraws = 1000;  // of a plane with a fifth of the places, 8 have all three on it
    constexpr std::size_t kAsked = 1000;
    Random random(1);
    const auto any = [&] {
      return places_[random.below(static_cast<std::uint32_t>(places_.size()))].x;
    };
    const std::size_t step = std::max<std::size_t>(1, places_.size() / kAsked);
    std::optional<Floor> best;
    double most = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      const Vec3 a = any();
      const Vec3 b = any();
      const Vec3 c = any();
      Vec3 normal = (b - a).cross(c - a);
      if (normal.norm() < spacing_ * spacing_) continue;
      normal.normalize();
      if (normal.dot(volume_.center - a) < 0) normal = -normal;
      const Floor plane{a, normal};
      if (!may_be_floor(plane)) continue;
      double on = 0;
      for (std::size_t i = 0; i < places_.size(); i += step)
        if (std::abs(plane.height(places_[i].x)) < kOn * spacing_)
          on += static_cast<double>(places_[i].weight);
      if (on <= most) continue;
      most = on;
      best = plane;
    }
    return best;
  }

  /// Least squares through the places on it.
  [[nodiscard]] std::optional<Floor> fitted(const Floor& plane) const {
    Vec3 sum = Vec3::Zero();
    double weight = 0;
    const auto visit = [&](auto&& add) {
      for (const NamedPlace& place : places_)
        if (std::abs(plane.height(place.x)) < kOn * spacing_)
          add(place.x, static_cast<double>(place.weight));
    };
    visit([&](const Vec3& x, double w) {
      sum += w * x;
      weight += w;
    });
    if (!(weight > 0)) return std::nullopt;
    const Vec3 middle = sum / weight;
    Mat3 scatter = Mat3::Zero();
    visit([&](const Vec3& x, double w) { scatter += w * (x - middle) * (x - middle).transpose(); });
    Vec3 normal = Eigen::SelfAdjointEigenSolver<Mat3>(scatter).eigenvectors().col(0);
    if (normal.dot(plane.normal) < 0) normal = -normal;
    const Floor better{middle, normal};
    return Floor{volume_.center - better.height(volume_.center) * normal, normal};
  }

  [[nodiscard]] Sides sides_of(const Floor& plane) const {
    Sides sides;
    for (const NamedPlace& place : places_) {
      const double height = plane.height(place.x) / spacing_;
      const auto weight = static_cast<double>(place.weight);
      const bool is_in = is_in_volume(place.x);
      if (std::abs(height) < kOn) {
        sides.on += weight;
      } else if (is_in && height > kClear) {
        sides.above += weight;
      } else if (is_in && height < -kClear) {
        sides.below += weight;
      }
    }
    return sides;
  }

  /// Share of the directions around the object in which the plane goes on beyond it.
  [[nodiscard]] double open_sides(const Floor& plane) const {
    constexpr int kSectors = 16;
    constexpr int kLeast = 10;  // places in a sector
    constexpr double kMostOfObject = 0.9;
    const Vec3 along = plane.normal.unitOrthogonal();
    const Vec3 across = plane.normal.cross(along);
    const auto on_plane = [&](const Vec3& x) { return Vec2(along.dot(x), across.dot(x)); };
    std::vector<double> xs, ys;
    for (const NamedPlace& place : places_) {
      if (!is_in_volume(place.x) || plane.height(place.x) < kClear * spacing_) continue;
      xs.push_back(on_plane(place.x).x());
      ys.push_back(on_plane(place.x).y());
    }
    if (xs.empty()) return 0;
    const Vec2 foot(upper_median(xs), upper_median(ys));
    std::vector<double> reaches;
    for (std::size_t i = 0; i < xs.size(); ++i)
      reaches.push_back((Vec2(xs[i], ys[i]) - foot).norm());
    const auto at = reaches.begin() + static_cast<std::ptrdiff_t>(
                                          kMostOfObject * static_cast<double>(reaches.size()));
    std::nth_element(reaches.begin(), at, reaches.end());
    const double reach = *at;
    std::array<int, kSectors> counts{};
    for (const NamedPlace& place : places_) {
      if (std::abs(plane.height(place.x)) > kOn * spacing_) continue;
      const Vec2 d = on_plane(place.x) - foot;
      if (d.norm() < reach) continue;
      const double turn = std::atan2(d.y(), d.x()) / (2 * std::numbers::pi) + 0.5;
      ++counts[std::min(kSectors - 1, static_cast<int>(turn * kSectors))];
    }
    return static_cast<double>(
               std::count_if(counts.begin(), counts.end(), [](int n) { return n >= kLeast; })) /
           kSectors;
  }

  [[nodiscard]] std::optional<FoundFloor> judged(const Floor& plane) const {
    // Chosen, far from what was seen (docs/sensors.md, "A room").
    constexpr double kMuch = 0.2;     // of the places
    constexpr double kNone = 0.03;    // of those on it: wrong names
    constexpr double kObject = 0.05;  // of those on it
    constexpr double kMostSides = 0.5;
    const Sides sides = sides_of(plane);
    double all = 0;
    for (const NamedPlace& place : places_) all += static_cast<double>(place.weight);
    const FoundFloor found{plane, sides.on / all, open_sides(plane)};
    if (found.share < kMuch || sides.below > kNone * sides.on || sides.above < kObject * sides.on ||
        found.sides < kMostSides)
      return std::nullopt;
    return found;
  }

  const Rig& rig_;
  Sphere volume_;
  double spacing_;
  std::vector<NamedPlace> places_;
};

}  // namespace

std::vector<NamedPlace> named_places(const Rig& rig, std::span<const GridGraph> graphs,
                                     const Labeling& labeling) {
  constexpr int kStep = 16;  // points
  std::vector<NamedPlace> places;
  for (const GridGraph& graph : graphs) {
    const Camera& camera = rig.camera(graph.camera);
    for (const LabeledRun& run : labeling.runs[static_cast<std::size_t>(graph.camera)]) {
      const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
      for (int i = run.begin + kStep / 2; i < run.end; i += kStep) {
        const Vec2 pixel = curve.points[static_cast<std::size_t>(i)].position.cast<double>();
        if (const auto x = place_on_line(rig, camera, pixel, run.label))
          places.push_back({*x, run.label.confidence});
      }
    }
  }
  return places;
}

std::optional<FoundFloor> find_floor(const Rig& rig, std::span<const NamedPlace> places) {
  if (rig.floor) return std::nullopt;
  return Search(rig, places).find();
}

}  // namespace pencilscan
