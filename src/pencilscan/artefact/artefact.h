#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/artefact/artefact_points.h"
#include "pencilscan/artefact/coverage.h"
#include "pencilscan/artefact/plane_fit.h"
#include "pencilscan/artefact/plane_surface.h"
#include "pencilscan/artefact/z_scores.h"

namespace pencilscan {

// Acceptance figures after the manner of VDI/VDE 2634 part 3 and ISO 10360-13, whose texts were not
// at hand: a ball, a ball bar or a plate of known size is measured in several positions, and the
// worst counts. Every figure stands twice: with nothing removed, and with the worst 3 per mille of
// the points removed. Definitions: docs/figures.md.

/// Share of the points that may be removed.
inline constexpr double kTrimmedShare = 0.003;

/// A figure with nothing removed, and with the worst 3 per mille removed; mm.
struct TwoFigures {
  double all = 0;
  double trimmed = 0;
};

/// One of the points that decide a figure.
struct WorstPoint {
  std::size_t index = 0;  ///< in the position's points
  double distance = 0;    ///< signed, from the fit to all points; mm
};

/// A direction from a ball's centre in which something else is: a stem, the bar.
struct LeftOutCone {
  Vec3 direction = Vec3::UnitZ();
  double half_angle_rad = 0;
};

struct ArtefactOptions {
  std::optional<double> diameter_mm;  ///< of the balls, calibrated
  std::optional<double> length_mm;    ///< between the balls' centres, calibrated
  std::optional<double> plate_length_mm, plate_width_mm;
  std::optional<double> plate_thickness_mm;  ///< takes one of two faces
  double border_mm = 0;                      ///< at the rim, left out; needs the thickness
  double bar_diameter_mm = 0;       ///< of what joins the balls: points around it are left out
  std::optional<LeftOutCone> stem;  ///< of a single ball: points in it are left out
  std::optional<Sphere> region;     ///< only what lies inside is the artefact
  std::uint64_t seed = 1;
};

struct BallFigures {
  ArtefactPoints points;              ///< those that were judged
  std::size_t left_out = 0;           ///< in the cone of a stem or a bar
  std::size_t removed = 0;            ///< 3 per mille
  double coverage = 0;                ///< share of `trimmed` within 1 % of its diameter of a point
  Sphere sphere;                      ///< least squares, free radius, all points
  Sphere trimmed;                     ///< the same of the points that remain
  TwoFigures form_mm;                 ///< PF
  std::optional<TwoFigures> size_mm;  ///< PS; with a calibrated diameter
  std::vector<WorstPoint> worst;      ///< ten: greatest minus least distance is form_mm.all
  std::optional<ZScores> z;           ///< against the trimmed sphere
};

struct BallBarFigures {
  std::vector<BallFigures> balls;        ///< two
  TwoFigures distance_mm;                ///< of centres fitted with the calibrated radius
  std::optional<TwoFigures> spacing_mm;  ///< SD; with a calibrated length
  std::size_t between = 0;  ///< points that lie between the balls: a bar that was not left out?
};

struct PlateFigures {
  ArtefactPoints points;
  std::size_t left_out = 0;  ///< of the other face, the rim and its border
  std::size_t removed = 0;
  double coverage = 0;  ///< share of the plate within 1 % of its diagonal of a point
  PlateRectangle rectangle;
  PlaneSurface surface;           ///< in the plate's plane, also beyond the stated sides
  Plane plane;                    ///< least squares, all points
  Plane trimmed;                  ///< of the points that remain
  TwoFigures flatness_mm;         ///< F
  std::vector<WorstPoint> worst;  ///< as of a ball
  std::optional<ZScores> z;
};

// The rig is for z-scores and says whether its unit is known; may be null. InputError where an
// option leaves none of the points.

/// StageError when no sphere fits, or none whose size differs by kSizeTolerance at most.
[[nodiscard]] BallFigures measure_sphere(const ArtefactPoints& points, const Rig* rig,
                                         const ArtefactOptions& options);
/// Needs options.diameter_mm. StageError where there are no two balls of about this size.
[[nodiscard]] BallBarFigures measure_ball_bar(const ArtefactPoints& points, const Rig* rig,
                                              const ArtefactOptions& options);
/// StageError when no plane fits. InputError when the surface goes on so far beyond the stated
/// sides that they cannot be this plate's.
[[nodiscard]] PlateFigures measure_plate(const ArtefactPoints& points, const Rig* rig,
                                         const ArtefactOptions& options);

/// What a user should know of a position: one sentence each.
[[nodiscard]] std::vector<std::string> artefact_warnings(const BallFigures& ball,
                                                         const ArtefactOptions& options);
[[nodiscard]] std::vector<std::string> artefact_warnings(const BallBarFigures& bar,
                                                         const ArtefactOptions& options);
[[nodiscard]] std::vector<std::string> artefact_warnings(const PlateFigures& plate,
                                                         const ArtefactOptions& options);

/// All positions of one artefact; one of the lists of figures is filled.
struct ArtefactTest {
  ArtefactOptions options;
  std::vector<BallFigures> spheres;
  std::vector<BallBarFigures> ball_bars;
  std::vector<PlateFigures> plates;
  std::vector<LackingPosition> lacking = {};  ///< which no figure is of
};

/// Every position and the worst of all. Keys: docs/figures.md.
[[nodiscard]] nlohmann::ordered_json artefact_json(const ArtefactTest& test);
/// One self-contained HTML page: figures, where the deviations lie, how often which.
[[nodiscard]] std::string artefact_html(const ArtefactTest& test, const std::string& program);

}  // namespace pencilscan
