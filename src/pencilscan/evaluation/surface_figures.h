#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "pencilscan/evaluation/statistics.h"
#include "pencilscan/evaluation/truth_scene.h"

namespace pencilscan {

/// A point drawn from a surface.
struct DrawnPoint {
  Vec3 point = Vec3::Zero();   ///< mm
  Vec3 normal = Vec3::Zero();  ///< unit, of the facet
  std::size_t face = 0;
};

/// `count` points, uniform by area, stratified along the face list; the seed moves them within
/// their strata. Empty for a mesh without area.
[[nodiscard]] std::vector<DrawnPoint> sample_surface(const TriangleMesh& mesh, std::size_t count,
                                                     std::uint64_t seed);

/// Which devices reach a point of the true surface.
struct Coverage {
  bool measurable =
      false;          ///< by one camera and one projector, both below 75 degrees, spacing >= 5 px
  bool seen = false;  ///< some camera sees it, at any incidence below 90 degrees
  int lit_by = 0;     ///< number of projectors that light it
  /// The sides that this is of: of one-sided surface, and where no camera sees it, the front.
  bool front = true;
  bool back = false;
};
struct CoverageOptions {
  double max_incidence_deg = 75;
  double min_spacing_px = 5;
};
/// `samples`: of the truth. Where it is two-sided, both sides count.
[[nodiscard]] std::vector<Coverage> surface_coverage(const TruthScene& truth,
                                                     const std::vector<DrawnPoint>& samples,
                                                     const CoverageOptions& options = {});

/// Exact distances of points to the surface of a scene.
[[nodiscard]] std::vector<double> distances_to(const RayScene& scene,
                                               const std::vector<Vec3>& points);

struct CompletenessOptions {
  std::vector<double> thresholds_mm = {0.5, 1, 2};
  double max_normal_deg = 60;         ///< between the true facet and the nearest facet
  std::size_t sample_count = 100000;  ///< of the true surface, and of the measured one
  std::uint64_t seed = 1;
};

/// Figures at one threshold.
struct CompletenessFigures {
  double threshold_mm = 0;
  double measurable = 0;  ///< share of the measurable surface
  double lit_by_one = 0;  ///< share of what is seen and lit by >= 1 projector
  double lit_by_two = 0;
  double precision = 0;  ///< share of the measured mesh within the threshold of the truth
  double f_score = 0;    ///< harmonic mean of `measurable` and `precision`
};

struct SurfaceFigures {
  DistanceFigures distance;     ///< of uniform samples of the measured mesh to the truth
  double measurable_share = 0;  ///< of the true area
  double lit_by_one_share = 0;  ///< seen and lit by >= 1
  double lit_by_two_share = 0;
  double measurable_mm2 = 0;
  std::vector<CompletenessFigures> completeness;  ///< one per threshold
  /// Of the distance of each measured vertex (confidence > 0); nothing for a mesh without sigma.
  std::optional<SigmaFigures> sigma;
};

/// Compares a measured mesh with the truth. `mm_per_unit` is the length of the rig's unit in mm,
/// where a similarity alignment found another one.
[[nodiscard]] SurfaceFigures surface_figures(const TruthScene& truth, const TriangleMesh& measured,
                                             const CompletenessOptions& options = {},
                                             double mm_per_unit = 1);

}  // namespace pencilscan
