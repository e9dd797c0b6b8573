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
#include "pencilscan/guided/second_look.h"
#include "pencilscan/labeling/measured_point.h"
#include "pencilscan/pipeline/method.h"
#include "pencilscan/pipeline/stage_clock.h"
#include "pencilscan/points/settle.h"
#include "pencilscan/points/triangulate.h"
#include "pencilscan/refinement/crossing_tracks.h"
#include "pencilscan/surface/holes.h"
#include "pencilscan/surface/surface.h"
#include "pencilscan/tracking/tracked_surface.h"

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
  std::vector<cv::Mat> images;  ///< one per camera: camera_values(); empty: missing
  /// The same moment in plain light, for colour: as `images`, or nothing at all.
  std::vector<cv::Mat> plain;
  std::optional<FrameTiming> timing;  ///< where the pictures have time stamps
};

struct PointOptions {
  DetectionOptions detection;
  GridOptions grid;
  MethodOptions method;
  SecondLookOptions second_look;  ///< of methods that may be guided
  TriangulationOptions triangulation;
  SettleOptions settle;  ///< of the same; others are triangulated as they are
  Progress progress;     ///< hears of every stage as it starts, with fraction 0
};

/// How the labelled points become a surface.
struct ShapeOptions {
  DepthStageOptions depth;
  FusionOptions fusion;    ///< of dense depth
  SurfaceOptions surface;  ///< of the curves alone, where dense depth is off or finds nothing
  /// The surface of the moment before, asked for when it is needed; null: there is none.
  std::function<std::shared_ptr<const TrackedSurface>()> before;
  /// Hears of this moment's surface as soon as it is there; nobody: it is not kept.
  std::function<void(std::shared_ptr<const TrackedSurface>)> hand_on;
  Progress progress;  ///< as in PointOptions
};

/// Labelled points of one frame and everything that led to them.
struct PointResult {
  std::vector<ColorFamily> families;
  std::vector<char> left_out;  ///< per camera: 1 where its picture is wrong; warnings say how
  std::vector<CameraDetection> detections;  ///< per camera; curves have moved into the graphs
  std::vector<GridGraph> graphs;            ///< per camera
  Labeling labeling;
  CrossingDisagreement crossings;  ///< joint only: the paper's two have none by construction
  std::vector<CrossingDisagreement> device_crossings;  ///< the same: cameras, then projectors
  bool rig_is_off = false;       ///< lines were named with the devices as the frame corrects them
  bool looked_again = false;     ///< after the dense surface
  std::size_t contradicted = 0;  ///< labelled curve points that the dense surface contradicted
  std::vector<MeasuredPoint> points;
  std::vector<StageTime> times;
  std::vector<Warning> warnings;
};

/// The first half of measure_points(): curves and grid graphs, which do not depend on where the
/// devices stand (joint), without labels and points.
[[nodiscard]] PointResult detect_frame(const Rig& rig, const Frame& frame,
                                       const PointOptions& options = {});

/// The steps below take lengths in footprints; reconstruct_frame() scales the rig.
///
/// The paper's Fig. 3 for one frame: detection and grid per camera, one solution over all cameras,
/// triangulation. Joint: where crossing lines say that the rig is off, lines are named with the
/// devices as the frame corrects them; points are triangulated with the rig as given, their sigma
/// grows by its error, and a warning says so.
[[nodiscard]] PointResult measure_points(const Rig& rig, const Frame& frame,
                                         const PointOptions& options = {});

/// Dense depth and surface of one frame.
struct ShapeResult {
  DepthResult depth;  ///< empty where it is off
  HoleReport holes;   ///< empty without dense depth
  SurfaceResult surface;
  std::shared_ptr<const RayScene>
      scene;              ///< of surface.mesh before its colours; null without dense depth
  int carried_since = 0;  ///< moments since the closed surface was made from nothing
  std::vector<StageTime> times;
};

/// Dense depth from the labelled points, checked between the views and fused into one closed
/// surface.
[[nodiscard]] ShapeResult measure_shape(const Rig& rig, const Frame& frame,
                                        const PointResult& points,
                                        const ShapeOptions& options = {});

/// What the dense surface says of the labels (joint): those that it contradicts go, lines that it
/// lets expect are looked for once more, and the points settle on it. Replaces the points; those of
/// the paper's methods, and all where the rig is off, stay as they are.
void look_again(const Rig& rig, const PointOptions& options, PointResult& points,
                ShapeResult& shape);

/// What a whole frame gives.
struct FrameResult {
  PointResult points;
  ShapeResult shape;  ///< empty without meshes
};

/// No curve of a frame could be given its line: the pictures themselves are why.
struct NothingFound : StageError {
  using StageError::StageError;
};

/// All of the above in order, in footprints (rig/rig.h), so that the rig's unit does not matter;
/// the result is in the rig's unit, without `scene`. NothingFound when no camera has a picture, or
/// no curve a label.
[[nodiscard]] FrameResult reconstruct_frame(const Rig& rig, const Frame& frame,
                                            const PointOptions& points, const ShapeOptions& shape,
                                            bool meshes = true);

}  // namespace pencilscan
