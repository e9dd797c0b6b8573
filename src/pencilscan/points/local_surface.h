#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

struct LocalSurfaceOptions {
  double reach_px = 6;         ///< standard deviation of the weight of points around; > 0
  int step_px = 6;             ///< between patches; >= 1
  int used_of_seven = 2;       ///< pixels of seven whose points are used: neighbours are alike
  double floor_px = 0.1;       ///< error that every point has: depth in pixel footprints
  double curvature = 4e-3;     ///< prior deviation of quadratic terms, relative depth per reach^2
  double alike_points = 1.7;   ///< thinned neighbours on a curve that share one error
  int min_points = 4;          ///< that agree
  double min_agreement = 0.6;  ///< share of the points within twice the reach
};

/// Inverse depth around a pixel of a camera as a quadratic function of the pixel. A plane gives
/// inverse depth that is linear in the pixel.
struct SurfacePatch {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  float scale_px = 1;   ///< unit of the terms
  float reference = 0;  ///< inverse depth that the coefficients are relative to, 1/mm; 0: no patch
  Eigen::Matrix<float, 6, 1> coefficients = Eigen::Matrix<float, 6, 1>::Zero();
  float sigma = 0;          ///< standard deviation of inverse depth at `pixel`, relative
  float spread = 0;         ///< RMS deviation of the points, in their own standard deviations
  float one_sidedness = 0;  ///< distance of the points' mean from `pixel`, in scale_px

  [[nodiscard]] bool exists() const { return reference > 0; }
  [[nodiscard]] float inverse_depth(const Eigen::Vector2f& at) const;
  /// d(inverse depth) / d(pixel).
  [[nodiscard]] Eigen::Vector2f gradient(const Eigen::Vector2f& at) const;
};

/// The surface that the labelled points of one camera show: patches on a lattice of its pixels,
/// each fitted robustly to the points of all projectors around it. There is no patch where too few
/// points agree on one surface. Grows with the points that are added.
class LocalSurface {
 public:
  explicit LocalSurface(const Camera& camera, const LocalSurfaceOptions& options = {});

  /// Adds points of this camera and fits the patches that they change. However points are dealt to
  /// calls, the patches are the same, if the order within cells of 8 px is.
  void add(std::span<const MeasuredPoint> points);

  /// The patch nearest to a pixel; nullptr: none.
  [[nodiscard]] const SurfacePatch* nearest(const Eigen::Vector2f& pixel) const;
  [[nodiscard]] std::span<const SurfacePatch> patches() const { return patches_; }
  /// Per patch, 1 where the last add() fitted it, 0 where it was left as it was.
  [[nodiscard]] std::span<const char> refitted() const { return refitted_; }
  /// Index in patches() of the patch nearest to a pixel of the image.
  [[nodiscard]] std::size_t patch_index(const Eigen::Vector2f& pixel) const;
  [[nodiscard]] int step_px() const { return options_.step_px; }

 private:
  struct Sample {
    Eigen::Vector2f pixel;
    float w;              ///< inverse depth
    float inverse_sigma;  ///< 1 / relative standard deviation
  };
  struct Neighborhood;
  static constexpr int kCell = 8;

  template <class Visit>
  void for_each_cell(const Eigen::Vector2f& pixel, float scale_px, Visit visit) const;
  /// In the cells around a pixel.
  [[nodiscard]] std::size_t samples_around(const Eigen::Vector2f& pixel, float scale_px) const;
  void gather(const Eigen::Vector2f& pixel, float scale_px, Neighborhood& around) const;
  [[nodiscard]] SurfacePatch fit(const Eigen::Vector2f& pixel, float scale_px,
                                 Neighborhood& around) const;
  [[nodiscard]] int cell_column(float x) const;
  [[nodiscard]] int cell_row(float y) const;

  LocalSurfaceOptions options_;
  Vec3 center_;
  Vec3 forward_;
  float floor_;  ///< least relative sigma
  int columns_;
  int rows_;
  int cell_columns_;
  int cell_rows_;
  std::vector<std::vector<Sample>> cells_;
  std::vector<SurfacePatch> patches_;   ///< row by row
  std::vector<std::size_t> fitted_to_;  ///< samples around each patch when it was fitted
  std::vector<char> refitted_;
};

}  // namespace pencilscan
