#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/core/progress.h"
#include "pencilscan/core/warning.h"
#include "pencilscan/depth/depth.h"
#include "pencilscan/detection/detect.h"
#include "pencilscan/grid/grid_graph.h"
#include "pencilscan/guided/guided_matching.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/pipeline/found_floor.h"
#include "pencilscan/pipeline/method.h"
#include "pencilscan/pipeline/stage_clock.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/surface/holes.h"
#include "pencilscan/surface/surface.h"
#include "pencilscan/tracking/tracked_surface.h"
#include "pencilscan/uncertainty/error_model.h"
#include "pencilscan/uncertainty/exposure_motion.h"

namespace pencilscan {

/// When the cameras of a frame opened their shutters.
struct FrameTiming {
  std::vector<double> offset_us;  ///< one per camera, after the median of the frame; 0: unknown
  std::vector<bool> is_late;      ///< it shows mostly another moment
  double spread_us = 0;           ///< latest minus earliest
};

/// One moment seen by all cameras.
struct Frame {
  std::string name;
  std::vector<cv::Mat> images;  ///< one per camera, as stored; empty: missing
  /// The same moment in plain light, for colour: as `images`, or nothing at all.
  std::vector<cv::Mat> plain;
  std::optional<FrameTiming> timing;  ///< where the pictures have time stamps
  std::vector<Warning> notes;         ///< what is known of the pictures before they are looked at
  std::vector<float> gains;  ///< per camera, of the light in `images` over that stored; empty: 1
};

/// False where no camera has a picture.
[[nodiscard]] bool has_pictures(const Frame& frame);

/// What decides the labelled points.
struct PointOptions {
  DetectionOptions detection;
  GridOptions grid;
  MethodOptions method;
  GuidedMatchingOptions guided;  ///< of methods that may be guided
  TriangulationOptions triangulation;
  SettleOptions settle;  ///< of the same; others are triangulated as they are
};

/// What decides how the labelled points become a surface.
struct ShapeOptions {
  DepthStageOptions depth;
  FusionOptions fusion;    ///< of dense depth
  SurfaceOptions surface;  ///< of the curves alone, where dense depth is off or finds nothing
};

/// All that decides the result of one frame. Plain values, which core/fields.h lists one by one.
struct FrameOptions {
  PointOptions points;
  ShapeOptions shape;
  bool meshes = true;     ///< false: labelled points alone
  int joined_pixels = 1;  ///< along a row, to one: a quicker, coarser look; in [1, 16]
};

/// Whom a frame talks to while it is made.
struct FrameLinks {
  Progress progress;  ///< hears of every stage as it starts, with fraction 0
  /// The surface of the moment before, asked for when it is needed; null: there is none.
  std::function<std::shared_ptr<const TrackedSurface>()> before;
  /// Hears of this moment's surface as soon as it is there; nobody: it is not kept.
  std::function<void(std::shared_ptr<const TrackedSurface>)> hand_on;
  /// Nobody reads the result: the frame is left as soon as its surface is handed on.
  bool only_hands_on = false;
};

/// The rig that a frame's lines were named with.
enum class RigInFrame {
  kAsGiven,
  kCorrected,        ///< and crossings meet with it
  kPartlyCorrected,  ///< and crossings meet better with it, or more curves have a name
};

/// Labelled points of one frame and everything that led to them. Each stage fills in its part.
struct PointResult {
  std::vector<ColorFamily> families;
  std::vector<char> left_out;  ///< per camera: 1 where its picture is wrong; warnings say how
  std::vector<CameraDetection> detections;  ///< per camera; curves have moved into the graphs
  std::vector<GridGraph> graphs;            ///< per camera
  Labeling labeling;
  CrossingDisagreement crossings;  ///< joint only: the paper's two have none by construction
  std::vector<CrossingDisagreement> device_crossings;  ///< the same: cameras, then projectors
  /// The rig as the frame corrects it, which lines were named with, where the one given is off.
  std::optional<Rig> corrected;
  RigInFrame rig_in_frame = RigInFrame::kAsGiven;
  std::optional<FoundFloor> floor;  ///< that the object stands on, where the rig states none
  bool is_on_surface = false;       ///< matched once more, and settled, on the dense surface
  std::size_t contradicted = 0;     ///< labelled curve points that the dense surface contradicted
  std::vector<MeasuredPoint> points;
  /// Of named lines that the object cannot show: on a stated floor, or outside the volume.
  std::vector<MeasuredPoint> background;
  /// Per point, footprints: what its sigma rests on. Empty where it did not settle on the surface.
  std::vector<PointEvidence> evidence;
  std::vector<Warning> warnings;
  std::vector<std::string> notes;  ///< what could not be told, and what to do; no fault
};

/// Dense depth and surface of one frame.
struct ShapeResult {
  DepthResult depth;  ///< empty where it is off
  HoleReport holes;   ///< empty without dense depth
  SurfaceResult surface;
  std::vector<char> unlit;  ///< per vertex of surface.mesh, 1: pictures are dark there (unlit.h)
  /// Of surface.mesh, the mean over moments where it rests: finish_shape() moves the vertices
  /// there. Empty where no moment comes before.
  std::vector<Vec3> steadied;
  std::shared_ptr<const RayScene>
      scene;              ///< of surface.mesh before its colours; null without dense depth
  ExposureMotion motion;  ///< within the exposure; not judged without dense depth
};

/// All its lengths times `factor`, without `scene`.
void scale_lengths(double factor, ShapeResult& shape);

/// What a whole frame gives.
struct FrameResult {
  PointResult points;
  ShapeResult shape;  ///< empty without meshes
  std::vector<StageTime> times;
};

/// A frame has no result, and the pictures themselves are why: another time gives none either.
struct PicturesAtFault : StageError {
  using StageError::StageError;
};
/// No curve of a frame could be given its line.
struct NothingFound : PicturesAtFault {
  using PicturesAtFault::PicturesAtFault;
};
/// Two projectors show each other's patterns.
struct ProjectorsExchanged : PicturesAtFault {
  using PicturesAtFault::PicturesAtFault;
};

/// The shape in one frame: the stages below in order. They work in footprints (rig/rig.h), so that
/// the rig's unit does not matter; the result is in the rig's unit, without `scene`. NothingFound
/// when no camera has a picture, or no curve a label.
[[nodiscard]] FrameResult reconstruct_frame(const Rig& rig, const Frame& frame,
                                            const FrameOptions& options = {},
                                            const FrameLinks& links = {});

// ---- its stages ---------------------------------------------------------------------------------

/// The rig as the stages take it: lengths in footprints, lines where their mean colour is.
[[nodiscard]] Rig in_footprints(const Rig& rig);

/// Detection and grid: the curves of each camera and their graph.
[[nodiscard]] PointResult detect_frame(const Rig& rig, const Frame& frame,
                                       const PointOptions& options = {},
                                       const StageClock& clock = {});

/// Heights of lines in the light that the pictures were stored in (Frame::gains), so that those of
/// other frames compare. Done once, when no stage follows.
void restore_light(const Frame& frame, PointResult& result);

/// Leaves a picture out: what was found in it, and the labels of that.
void forget_camera(std::size_t camera, PointResult& result);

/// What the pictures themselves say: warnings; those that are plainly wrong are left out.
[[nodiscard]] PointResult check_pictures(const Rig& rig, const Frame& frame, PointResult curves);

/// Solution: the line of each curve. Of a method that may correct the rig (joint), pictures that do
/// not fit are left out, and where crossing lines say that the rig is off, lines are named with the
/// devices as the frame corrects them. ProjectorsExchanged when two projectors are.
[[nodiscard]] PointResult solve_frame(const Rig& rig, const Frame& frame, PointResult curves,
                                      const PointOptions& options = {},
                                      const StageClock& clock = {});

/// As `options`, for points on whose dense surface match_on_surface() looks again: the surface that
/// the labels show need not find all lines.
[[nodiscard]] PointOptions before_surface(PointOptions options);

/// From lines to points: guided matching on the surface that the labels show, then camera rays meet
/// light sheets. Points are triangulated with the rig as given; where it is off, their sigma grows
/// by its error.
[[nodiscard]] PointResult place_points(const Rig& rig, PointResult lines,
                                       const PointOptions& options = {},
                                       const StageClock& clock = {});

/// Dense depth from the labelled points, checked between the views and fused into one closed
/// surface, whose measured part finish_shape() takes.
[[nodiscard]] ShapeResult measure_shape(const Rig& rig, const Frame& frame,
                                        const PointResult& points, const ShapeOptions& options = {},
                                        const FrameLinks& links = {}, const StageClock& clock = {});

/// Guided matching on the dense surface (of methods that may be guided): labels that it contradicts
/// go, lines that it lets expect are looked for, and the points settle on it. Where the rig is off
/// everything stays as it is.
[[nodiscard]] FrameResult match_on_surface(const Rig& rig, FrameResult result,
                                           const PointOptions& options = {},
                                           const StageClock& clock = {});

/// What of the surface was measured, and what it is worth. Where lines were matched on the surface,
/// what none of the points lies near was not measured after all (surface/supported.h). In a
/// sequence, vertices that rest take their mean over moments: nothing else rests on that.
[[nodiscard]] FrameResult finish_shape(const Rig& rig, FrameResult result,
                                       const FusionOptions& options = {});

/// Where the object moved within the exposure, points and surface are as much less sure as that
/// makes them.
[[nodiscard]] FrameResult count_motion(const Rig& rig, FrameResult result);

/// From lines to the whole result, in footprints. NothingFound when there are no points.
[[nodiscard]] FrameResult measure_frame(const Rig& rig, const Frame& frame, PointResult lines,
                                        const FrameOptions& options, const FrameLinks& links,
                                        const StageClock& clock);

/// A result in footprints in the rig's unit, without `scene`. Warns of motion within the exposure.
[[nodiscard]] FrameResult in_unit_of(const Rig& rig, FrameResult result);

}  // namespace pencilscan
