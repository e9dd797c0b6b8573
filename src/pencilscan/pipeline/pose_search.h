#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/refinement/correction.h"

namespace pencilscan {

/// A place of a line in space, and its colour.
struct PlaceOfLine {
  Vec3 position;
  std::size_t family = 0;
  std::size_t layer = 0;   ///< of a camera's pictures: frame and family
  std::uint8_t color = 0;  ///< a bit
};

[[nodiscard]] inline std::uint8_t bit_of_color(std::ptrdiff_t color) {
  return static_cast<std::uint8_t>(1U << (color % 8));
}

/// Lines count as where they are within this share of what lies between two of them.
inline constexpr double kBesideLine = 1.0 / 6;
inline constexpr std::size_t kMostPlaces = 1500;   // shares are known to 1.3 %
inline constexpr std::size_t kLeastOfFamily = 50;  // to 7 %

struct PoseSearchOptions {
  double reach = 0.125;          ///< of the picture's longer side: how far a device may be turned
  double most_roll_degrees = 5;  ///< about the optical axis
};

/// A line in the picture of a device, beside a pixel.
struct LineBeside {
  Vec2 position;  ///< px
  Vec2 normal;    ///< unit
};

/// A way of the picture, and the share of the places that show a line of their colour then: the
/// geometric mean over the families. A picture that goes along the lines of one family still shows
/// these, and of another family, whose lines have another direction, no more than chance has it.
struct PictureWay {
  Vec3 rotation_px = Vec3::Zero();
  double share = 0;
};

/// Where a device stands in whose picture places of lines lie on lines of their colours. `Picture`
/// has
///   bool shows(const Vec2& pixel, const PlaceOfLine&): a line of its colour is there;
///   std::optional<LineBeside> nearest(const Vec2& pixel, const PlaceOfLine&, double radius_px);
///   bool tells(int axis): a shift along this axis of the picture changes what it shows.
template <class Picture>
class PoseSearch {
 public:
  /// `places` by family, and `step_px`, what shows() takes for a line's place, to both sides.
  PoseSearch(const Device& device, std::vector<PlaceOfLine> places, const Picture& picture,
             double step_px, const PoseSearchOptions& options)
      : device_(device),
        places_(std::move(places)),
        picture_(picture),
        step_(step_px),
        reach_(options.reach * std::max(device.width, device.height)),
        most_roll_(options.most_roll_degrees * std::numbers::pi / 180 * device.focal_px()) {
    for (std::size_t begin = 0, end = 0; begin < places_.size(); begin = end) {
      while (end < places_.size() && places_[end].family == places_[begin].family) ++end;
      // Of fewer a share says little.
      if (end - begin >= kLeastOfFamily) families_.emplace_back(begin, end);
    }
  }

  [[nodiscard]] bool has_places() const { return !families_.empty(); }
  [[nodiscard]] std::span<const PlaceOfLine> places() const { return places_; }

  /// All turns within reach, in steps.
  [[nodiscard]] std::vector<PictureWay> ways() const {
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
    return ways;
  }

  /// True for turns that are more than what lies between two lines apart.
  [[nodiscard]] bool are_apart(const PictureWay& a, const PictureWay& b) const {
    constexpr double kElsewhere = 1 / kBesideLine;  // steps
    const Vec3 apart = a.rotation_px - b.rotation_px;
    // A turn about y moves the picture along x, one about x moves it against y.
    const Vec2 seen(picture_.tells(0) ? apart.y() : 0, picture_.tells(1) ? apart.x() : 0);
    return seen.norm() > kElsewhere * step_;
  }

  /// The share of places that show a line of their colour.
  [[nodiscard]] double shown(const PoseCorrection& correction) const {
    return shown(pixels_of(correction), Vec2::Zero());
  }

  [[nodiscard]] std::vector<std::optional<Vec2>> pixels_of(const PoseCorrection& correction) const {
    Device moved = device_;
    moved.device_from_world = corrected_pose(device_, correction);
    std::vector<std::optional<Vec2>> pixels;
    for (const PlaceOfLine& place : places_) pixels.push_back(moved.project(place.position));
    return pixels;
  }

  /// The pose, near this one, at which places lie on the nearest lines of their colours (iterated
  /// closest points, Besl and McKay 1992, across the lines).
  [[nodiscard]] PoseCorrection settle(PoseCorrection correction) const {
    constexpr int kRounds = 15;
    constexpr double kFirstReach = 2;  // steps; the last one is one
    for (int round = 0; round < kRounds; ++round) {
      const double reach = step_ * (kFirstReach - (kFirstReach - 1) * round / (kRounds - 1));
      Device moved = device_;
      moved.device_from_world = corrected_pose(device_, correction);
      Mat6 normal = Mat6::Zero();
      Vec6 right = Vec6::Zero();
      for (const PlaceOfLine& place : places_) {
        const Vec3 x = moved.device_from_world * place.position;
        const std::optional<Vec2> pixel = moved.project(place.position);
        const auto line = pixel ? picture_.nearest(*pixel, place, reach) : std::nullopt;
        if (!line) continue;
        const Eigen::Matrix<double, 1, 6> row = line->normal.transpose() *
                                                projection_jacobian(moved, x) *
                                                pose_jacobian(device_, correction, x);
        normal += row.transpose() * row;
        right += row.transpose() * line->normal.dot(line->position - *pixel);
      }
      // Of turn and shift a pixel or a footprint each, as far as nothing tells them apart.
      normal.diagonal().array() += 1;
      const Vec6 change = solve_symmetric(normal, right);
      correction.rotation_px += change.head<3>();
      correction.translation_mm += change.tail<3>();
    }
    return correction;
  }

 private:
  /// Within a block a turn is a shift of the picture: over so many steps the difference is far
  /// below one.
  static constexpr int kBlock = 16;

  static int steps(double reach, double step) { return static_cast<int>(std::ceil(reach / step)); }
  /// At the picture's edge a step.
  [[nodiscard]] double roll_step() const {
    return step_ * 4 * device_.focal_px() / std::max(device_.width, device_.height);
  }

  /// Of places that are seen at these pixels, the picture shifted.
  [[nodiscard]] double shown(std::span<const std::optional<Vec2>> pixels, const Vec2& shift) const {
    double product = 1;
    for (const auto& [begin, end] : families_) {
      std::size_t count = 0;
      for (std::size_t i = begin; i < end; ++i)
        count += pixels[i] && picture_.shows(*pixels[i] + shift, places_[i]) ? 1U : 0U;
      product *= static_cast<double>(count) / static_cast<double>(end - begin);
    }
    return std::pow(product, 1 / static_cast<double>(families_.size()));
  }

  /// What half a block around a turn shows.
  [[nodiscard]] std::vector<PictureWay> ways_around(const Vec3& rotation_px) const {
    const auto pixels = pixels_of({rotation_px, Vec3::Zero()});
    const auto within = [&](int axis) {
      return picture_.tells(axis) ? std::pair(-kBlock / 2, kBlock / 2) : std::pair(0, 1);
    };
    const auto [left, right] = within(0);
    const auto [above, below] = within(1);
    std::vector<PictureWay> ways;
    for (int v = above; v < below; ++v) {
      for (int u = left; u < right; ++u) {
        // A turn about y moves the picture along x, one about x moves it against y.
        ways.push_back({rotation_px + Vec3(-v * step_, u * step_, 0),
                        shown(pixels, Vec2(u * step_, v * step_))});
      }
    }
    return ways;
  }

  const Device& device_;
  std::vector<PlaceOfLine> places_;
  const Picture& picture_;
  double step_;
  double reach_;
  double most_roll_;
  std::vector<std::pair<std::size_t, std::size_t>> families_;  ///< of the places
};

}  // namespace pencilscan
