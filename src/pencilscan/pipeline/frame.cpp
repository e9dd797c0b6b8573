#include "pencilscan/pipeline/frame.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/pipeline/frame_warnings.h"
#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/picture_check.h"
#include "pencilscan/points/surface_check.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/surface/manifold.h"
#include "pencilscan/surface/vertex_color.h"

namespace pencilscan {
namespace {

void announce(const Progress& progress, const char* stage) {
  if (progress) progress(stage, 0);
}

/// Forgets what the cameras of the findings saw.
void leave_out(const Rig& rig, const std::vector<PictureFinding>& findings, PointResult& result) {
  for (const PictureFinding& finding : findings) {
    const auto c = static_cast<std::size_t>(finding.camera);
    result.left_out[c] = 1;
    result.detections[c] = {};
    result.graphs[c] = {};
    result.graphs[c].camera = finding.camera;
    result.warnings.push_back(
        {WarningCode::kWrongPicture, describe(rig, finding), rig.camera(finding.camera).name});
  }
}

/// The frame without the pictures that were left out.
Frame without(Frame frame, const std::vector<char>& left_out) {
  for (std::size_t c = 0; c < left_out.size(); ++c) {
    if (left_out[c] != 0) frame.images[c] = cv::Mat();
  }
  return frame;
}

/// Error of each plane, projector px, that makes crossings miss each other as they do.
double plane_error_px(const CrossingDisagreement& crossings) {
  const double noise2 = crossings.expected_px * crossings.expected_px;
  const double devices2 = crossings.median_px * crossings.median_px - noise2;
  return kDeviationPerMedian * std::sqrt(std::max(0.0, devices2) / 2);
}

/// Why a frame has no points.
std::string why_nothing(const PointResult& result) {
  std::string why = "no curve could be given its projector line";
  for (const Warning& warning : result.warnings) {
    if (warning.code == WarningCode::kWrongPicture) why += "; " + warning.text;
  }
  return why;
}

/// Of all cameras; they share their pixels with the detections.
std::vector<std::vector<cv::Mat>> presence_images(std::span<const CameraDetection> detections) {
  std::vector<std::vector<cv::Mat>> presence;
  for (const CameraDetection& detection : detections) presence.push_back(detection.presence);
  return presence;
}

/// The nodes of all depth maps.
std::vector<MeasuredPoint> dense_points(const Rig& rig, std::span<const DepthMap> maps) {
  std::vector<MeasuredPoint> points;
  for (const DepthMap& map : maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      if (!map.nodes[i].measured()) continue;
      const Vec3 x = node_point(rig, map, i);
      const Vec2 pixel = map.pixel(i);
      MeasuredPoint p;
      p.x = static_cast<float>(x.x());
      p.y = static_cast<float>(x.y());
      p.z = static_cast<float>(x.z());
      p.u = static_cast<float>(pixel.x());
      p.v = static_cast<float>(pixel.y());
      p.camera = static_cast<std::uint8_t>(map.camera);
      const double length = camera.normalized_from_pixel(pixel).homogeneous().norm();
      p.sigma = map.nodes[i].sigma * static_cast<float>(length);
      points.push_back(p);
    }
  }
  return points;
}

/// `linear` with NaN where the image as read is overexposed.
cv::Mat without_overexposed(const cv::Mat& linear, const cv::Mat& values) {
  cv::Mat image = linear.clone();
  image.setTo(cv::Scalar::all(std::nan("")), overexposed(values));
  return image;
}

/// What camera c sees in the light of the projectors, or in plain light where it is a texture
/// camera.
ColorView lit_view(const Rig& rig, const Frame& frame, std::size_t c, const PointResult& points,
                   const DepthReport& depth) {
  const Camera& camera = rig.cameras[c];
  ColorView view;
  view.camera = static_cast<int>(c);
  view.is_plain = camera.sees_texture_only;
  const cv::Mat linear = linear_light(camera, frame.images[c]);
  view.image = view.is_plain ? registered(camera, linear)
                             : projector_light(camera, linear, points.detections[c].unmixing);
  view.image = without_overexposed(view.image, frame.images[c]);
  for (const CameraDepthReport& of_camera : depth.cameras) {
    if (of_camera.camera == view.camera) view.blur_px = of_camera.blur_px;
  }
  return view;
}

ColorView plain_view(const Rig& rig, const Frame& frame, std::size_t c) {
  const Camera& camera = rig.cameras[c];
  ColorView view;
  view.camera = static_cast<int>(c);
  view.is_plain = true;
  view.image =
      without_overexposed(registered(camera, linear_light(camera, frame.plain[c])), frame.plain[c]);
  return view;
}

/// Images as vertex_colors() wants them.
std::vector<ColorView> color_views(const Rig& rig, const Frame& frame, const PointResult& points,
                                   const DepthReport& depth) {
  std::vector<std::function<ColorView()>> makers;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (!frame.images[c].empty())
      makers.push_back([&, c] { return lit_view(rig, frame, c, points, depth); });
  }
  for (std::size_t c = 0; c < frame.plain.size(); ++c) {
    if (!frame.plain[c].empty()) makers.push_back([&, c] { return plain_view(rig, frame, c); });
  }
  std::vector<ColorView> views(makers.size());
  parallel_for(views.size(), [&](std::size_t i) { views[i] = makers[i](); });
  return views;
}

/// Of the cameras that see the projectors' light.
std::vector<Silhouette> silhouettes_of(const Rig& rig, const std::vector<ColorView>& views) {
  std::vector<const ColorView*> lit;
  for (const ColorView& view : views) {
    if (!view.is_plain) lit.push_back(&view);
  }
  std::vector<Silhouette> silhouettes(lit.size());
  parallel_for(lit.size(), [&](std::size_t i) {
    const Camera& camera = rig.camera(lit[i]->camera);
    silhouettes[i] = silhouette(lit[i]->camera, lit[i]->image, line_reach_px(rig, camera));
  });
  return silhouettes;
}

/// The measured mesh has vertices of the closed one, in the same order.
void copy_colors(const TriangleMesh& mesh, TriangleMesh& measured) {
  std::size_t v = 0;
  for (const Vec3& x : measured.vertices) {
    while (v < mesh.vertices.size() && mesh.vertices[v] != x) ++v;
    if (v == mesh.vertices.size()) break;
    measured.color.push_back(mesh.color[v]);
  }
  PENCILSCAN_CHECK(measured.color.size() == measured.vertices.size());
}

void scale(double factor, TriangleMesh& mesh) {
  for (Vec3& x : mesh.vertices) x *= factor;
  for (float& sigma : mesh.sigma) sigma *= static_cast<float>(factor);
}

/// From footprints to the rig's unit.
void scale(double factor, FrameResult& result) {
  const auto f = static_cast<float>(factor);
  for (MeasuredPoint& p : result.points.points) {
    for (float* length : {&p.x, &p.y, &p.z, &p.sigma}) *length *= f;
  }
  ShapeResult& shape = result.shape;
  scale(factor, shape.surface.mesh);
  scale(factor, shape.surface.measured);
  shape.surface.report.spacing_mm *= factor;
  for (double& area : shape.holes.area_mm2) area *= factor * factor;
  for (CameraDepthReport& camera : shape.depth.report.cameras) camera.sigma_median_mm *= factor;
  for (DepthMap& map : shape.depth.maps) {
    for (DepthNode& node : map.nodes) {
      for (float* inverse : {&node.w, &node.wx, &node.wy, &node.wxx, &node.wxy, &node.wyy})
        *inverse /= f;
      node.sigma *= f;
    }
  }
  // Scaling and files round: what lay apart may lie at one place.
  separate_vertices(shape.surface.mesh);
  separate_vertices(shape.surface.measured);
  shape.scene.reset();
}

}  // namespace

PointResult detect_frame(const Rig& rig, const Frame& frame, const PointOptions& options) {
  PointResult result;
  result.families = color_families(rig);
  const std::size_t cameras = rig.cameras.size();

  announce(options.progress, "detection");
  Stopwatch detection_watch;
  result.detections.resize(cameras);
  parallel_for(cameras, [&](std::size_t c) {
    if (frame.images[c].empty() || rig.cameras[c].sees_texture_only) return;
    result.detections[c] =
        detect_curves(rig.cameras[c], rig, result.families, frame.images[c], options.detection);
  });
  result.warnings = detection_warnings(rig, frame, result.families, result.detections);
  result.times.push_back({"detection", detection_watch.seconds()});

  announce(options.progress, "grid");
  Stopwatch grid_watch;
  GridOptions grid = options.grid;
  grid.identify = grid.identify && solution_method(options.method).capabilities.needs_identities;
  result.graphs.resize(cameras);
  parallel_for(cameras, [&](std::size_t c) {
    result.graphs[c] = build_grid_graph(rig, result.families, static_cast<int>(c),
                                        std::move(result.detections[c].curves), grid);
  });
  result.times.push_back({"grid", grid_watch.seconds()});
  return result;
}

PointResult measure_points(const Rig& stated, const Frame& frame, const PointOptions& options) {
  const Rig rig = with_registered_patterns(stated);
  PointResult result = detect_frame(rig, frame, options);
  if (std::optional<Warning> warning = interpolation_warning(rig, frame))
    result.warnings.push_back(std::move(*warning));
  result.left_out.assign(rig.cameras.size(), 0);
  leave_out(rig, plain_faults(rig, frame), result);
  announce(options.progress, "solution");
  Stopwatch solution_watch;
  const SolutionMethod& method = solution_method(options.method);
  result.labeling = method.solve(rig, result.families, result.graphs, options.method);
  if (!method.capabilities.may_be_guided) {
    result.times.push_back({"solution", solution_watch.seconds()});
    const Stopwatch triangulation_watch;
    result.points = triangulate(rig, result.graphs, result.labeling, options.triangulation);
    result.times.push_back({"triangulation", triangulation_watch.seconds()});
    return result;
  }
  const std::vector<PictureFinding> misplaced =
      misplaced_pictures(rig, frame, result.graphs, result.labeling, options);
  if (!misplaced.empty()) {
    leave_out(rig, misplaced, result);
    result.labeling = method.solve(rig, result.families, result.graphs, options.method);
  }
  LineNaming naming =
      name_lines(rig, result.families, result.graphs, std::move(result.labeling), options);
  result.labeling = std::move(naming.labeling);
  result.crossings = naming.crossings;
  result.device_crossings = std::move(naming.device_crossings);
  if (naming.warning) result.warnings.push_back(std::move(*naming.warning));
  const std::optional<Rig>& corrected = naming.corrected;
  result.rig_is_off = corrected.has_value();
  result.times.push_back({"solution", solution_watch.seconds()});

  announce(options.progress, "second look");
  const Stopwatch second_look_watch;
  std::vector<LocalSurface> surfaces =
      second_look(corrected ? *corrected : rig, result.families, presence_images(result.detections),
                  result.graphs, result.labeling, options.second_look);
  result.times.push_back({"second look", second_look_watch.seconds()});

  announce(options.progress, "triangulation");
  const Stopwatch triangulation_watch;
  TriangulationOptions triangulation = options.triangulation;
  SettleOptions settle = options.settle;
  if (corrected) {
    triangulation.projection_sigma_px =
        std::max(triangulation.projection_sigma_px, plane_error_px(result.crossings));
    settle.errors_are_shared = true;
  }
  result.points = triangulate(rig, result.graphs, result.labeling, triangulation);
  if (corrected) surfaces = local_surfaces(rig, result.points, options.second_look.surface);
  result.points = settle_points(rig, result.points, surfaces, settle);
  result.times.push_back({"triangulation", triangulation_watch.seconds()});
  return result;
}

ShapeResult measure_shape(const Rig& stated, const Frame& frame, const PointResult& points,
                          const ShapeOptions& options) {
  const Rig rig = with_registered_patterns(stated);
  ShapeResult result;
  if (options.depth.enabled) {
    announce(options.progress, "depth");
    const Stopwatch depth_watch;
    std::vector<Unmixing> unmixings;
    for (const CameraDetection& detection : points.detections)
      unmixings.push_back(detection.unmixing);
    result.depth =
        measure_depth(rig, points.families, frame.images, unmixings, points.points, options.depth);
    result.times.push_back({"depth", depth_watch.seconds()});
    announce(options.progress, "surface");
    const Stopwatch surface_watch;
    const std::vector<ColorView> views = color_views(rig, frame, points, result.depth.report);
    const std::vector<DepthMap>& maps = result.depth.maps;
    result.surface = close_depth(rig, maps, options.fusion, silhouettes_of(rig, views));
    complete_depth(rig, RayScene(result.surface.mesh), options.depth, result.depth);
    result.depth.lights.clear();
    follow_depth(rig, points.points, maps, options.fusion, result.surface);
    result.times.push_back({"surface", surface_watch.seconds()});
    if (result.surface.report.status != SurfaceStatus::kTooFewPoints) {
      const Stopwatch hole_watch;
      result.scene = std::make_shared<RayScene>(result.surface.mesh);
      result.holes = explain_holes(rig, *result.scene, result.depth.maps);
      for (const HoleReason reason : result.holes.vertices)
        result.surface.mesh.hole.push_back(static_cast<std::uint8_t>(reason));
      result.times.push_back({"holes", hole_watch.seconds()});
      const Stopwatch color_watch;
      TriangleMesh& mesh = result.surface.mesh;
      mesh.color = vertex_colors(rig, *result.scene, views);
      if (!mesh.color.empty()) copy_colors(mesh, result.surface.measured);
      result.times.push_back({"color", color_watch.seconds()});
      return result;
    }
  }
  announce(options.progress, "surface");
  const Stopwatch surface_watch;
  result.surface = reconstruct_surface(rig, points.points, options.surface);
  result.times.push_back({"surface", surface_watch.seconds()});
  if (options.depth.enabled) {
    result.surface.report.warnings.push_back(
        {WarningCode::kCurvesOnly,
         "dense depth found too little: the surface rests on the labelled curves alone"});
  }
  return result;
}

void look_again(const Rig& stated, const PointOptions& options, PointResult& points,
                ShapeResult& shape) {
  if (!solution_method(options.method).capabilities.may_be_guided || points.rig_is_off ||
      !shape.scene)
    return;
  announce(options.progress, "look again");
  const Stopwatch watch;
  const Rig rig = with_registered_patterns(stated);
  points.looked_again = true;
  points.contradicted = drop_contradicted(rig, *shape.scene, points.graphs, points.labeling);
  const std::vector<LocalSurface> surfaces =
      second_look(rig, points.families, presence_images(points.detections), points.graphs,
                  points.labeling, options.second_look, dense_points(rig, shape.depth.maps));
  const std::vector<MeasuredPoint> triangulated =
      triangulate(rig, points.graphs, points.labeling, options.triangulation);
  SettledPoints settled = settle_on_surface(
      rig, *shape.scene, settle_points(rig, triangulated, surfaces, options.settle),
      shape.surface.mesh.color);
  points.points = std::move(settled.points);
  points.contradicted += settled.contradicted;
  SurfaceReport& report = shape.surface.report;
  shape.surface.used = std::move(settled.on_surface);
  report.points = points.points.size();
  report.points_used =
      static_cast<std::size_t>(std::count(shape.surface.used.begin(), shape.surface.used.end(), 1));
  points.times.push_back({"look again", watch.seconds()});
}

FrameResult reconstruct_frame(const Rig& stated, const Frame& frame, const PointOptions& points,
                              const ShapeOptions& shape, bool meshes) {
  const double unit = footprint(stated);
  const Rig rig = scaled(stated, 1 / unit);
  if (std::all_of(frame.images.begin(), frame.images.end(),
                  [](const cv::Mat& image) { return image.empty(); })) {
    throw NothingFound("no camera of the rig has a picture of this moment");
  }
  FrameResult result;
  result.points = measure_points(rig, frame, points);
  if (result.points.points.empty()) throw NothingFound(why_nothing(result.points));
  if (meshes) {
    const Frame right = without(frame, result.points.left_out);
    result.shape = measure_shape(rig, right, result.points, shape);
  }
  std::vector<StageTime>& times = result.points.times;
  times.insert(times.end(), result.shape.times.begin(), result.shape.times.end());
  look_again(rig, points, result.points, result.shape);
  scale(unit, result);
  return result;
}

}  // namespace pencilscan
