#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/core/eigen.hpp>
#include <utility>
#include <vector>

#include "pencilscan/core/parallel.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pipeline/frame.h"
#include "pencilscan/rig/camera_light.h"
#include "pencilscan/rig/object_space.h"
#include "pencilscan/surface/supported.h"
#include "pencilscan/surface/unlit.h"
#include "pencilscan/surface/untangle.h"
#include "pencilscan/surface/vertex_color.h"
#include "pencilscan/tracking/steady.h"

namespace pencilscan {
namespace {

void scale(double factor, TriangleMesh& mesh) {
  for (Vec3& x : mesh.vertices) x *= factor;
  for (float& sigma : mesh.sigma) sigma *= static_cast<float>(factor);
}

/// What camera c sees, linear: the image as stored where that is all that there is to it.
/// `unmixing`: of an image with patterns.
ColorView view_of(const Rig& rig, std::size_t c, const cv::Mat& stored, const Unmixing* unmixing) {
  const Camera& camera = rig.cameras[c];
  const bool is_registered = !camera.color_registration.none();
  ColorView view;
  view.camera = static_cast<int>(c);
  view.is_plain = unmixing == nullptr;
  const bool is_as_stored =
      camera.gamma == 1 && camera.black_level == 0 && !camera.mosaic && !is_registered;
  view.image = is_as_stored ? stored : linear_light(camera, stored);
  if (is_registered) {  // colours are unmixed where the sensor has them
    view.image = unmixing != nullptr ? projector_light(camera, view.image, *unmixing)
                                     : registered(camera, view.image);
  } else if (unmixing != nullptr) {
    view.light_from_image = unmixing->projector_from_camera.cast<float>();
  }
  if (is_as_stored) {
    view.full = kFullRange;
  } else {
    view.image.setTo(cv::Scalar::all(std::nan("")), overexposed(stored));
  }
  return view;
}

/// The same in the light of the projectors, or in plain light where it is a texture camera.
ColorView lit_view(const Rig& rig, const Frame& frame, std::size_t c, const PointResult& points,
                   const DepthReport& depth) {
  const bool is_plain = rig.cameras[c].sees_texture_only;
  ColorView view =
      view_of(rig, c, frame.images[c], is_plain ? nullptr : &points.detections[c].unmixing);
  for (const CameraDepthReport& of_camera : depth.cameras) {
    if (of_camera.camera == view.camera) view.blur_px = of_camera.blur_px;
  }
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
    if (!frame.plain[c].empty())
      makers.push_back([&, c] { return view_of(rig, c, frame.plain[c], nullptr); });
  }
  std::vector<ColorView> views(makers.size());
  parallel_for(views.size(), [&](std::size_t i) { views[i] = makers[i](); });
  return views;
}

/// Light of the projectors in the whole image; NaN where overexposed.
cv::Mat light_of(const ColorView& view) {
  cv::Mat matrix;
  cv::eigen2cv(view.light_from_image, matrix);
  cv::Mat light;
  cv::transform(unit_image(view.image), light, matrix);
  if (std::isfinite(view.full)) light.setTo(cv::Scalar::all(std::nan("")), overexposed(view.image));
  return light;
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
    silhouettes[i] = silhouette(lit[i]->camera, light_of(*lit[i]), line_reach_px(rig, camera));
  });
  return silhouettes;
}

/// Dense depth of all cameras.
DepthResult depth_of(const Rig& rig, const Frame& frame, const PointResult& points,
                     const DepthStageOptions& options) {
  return measure_depth(rig, points.families, frame.images, points.detections, points.points,
                       options, points.background);
}

/// The surface goes on to the next moment: where it rests, as the mean over moments has it. The
/// frame's own result takes these vertices at its end (finish_shape()).
void hand_on(const FrameLinks& links, std::vector<std::array<int, 3>> coarse_faces,
             ShapeResult& result) {
  const TriangleMesh& measured = result.surface.mesh;
  TrackedSurface next;
  next.coarse_faces = std::move(coarse_faces);
  next.mesh.vertices = measured.vertices;
  next.mesh.faces = measured.faces;
  next.mesh.sigma = measured.sigma;
  next.mesh.confidence = measured.confidence;
  if (const auto before = links.before ? links.before() : nullptr) {
    Steadied steadied =
        steady_surface(*before, result.surface.report.spacing_mm, next.coarse_faces, next.mesh);
    next.variance = std::move(steadied.variance);
    next.motion = steadied.motion;
    // The measured surface was untangled; where it moved on, others may be left.
    std::size_t& intersections = result.surface.report.self_intersections;
    intersections = std::max(intersections, untangle(measured.vertices, next.mesh));
    result.steadied = next.mesh.vertices;
  } else {
    next.variance = first_variance(next.mesh);
  }
  links.hand_on(std::make_shared<const TrackedSurface>(std::move(next)));
}

/// Surface that pictures show as dark was not measured.
void leave_unlit(const Rig& rig, const RayScene& closed, ShapeResult& result) {
  TriangleMesh& mesh = result.surface.mesh;
  if (mesh.confidence.empty()) return;
  result.unlit = unlit_vertices(rig, closed, result.depth.lights, mesh, result.surface.evidence);
  for (std::size_t v = 0; v < result.unlit.size(); ++v)
    if (result.unlit[v] != 0) mesh.confidence[v] = 0;
}

/// The depth maps become one closed surface, which lets depth be completed where it was missing and
/// then follows it.
void fuse(const Rig& rig, const PointResult& points, const std::vector<ColorView>& views,
          const ShapeOptions& options, const FrameLinks& links, ShapeResult& result) {
  SurfaceResult& surface = result.surface;
  surface = close_depth(rig, result.depth.maps, options.fusion, silhouettes_of(rig, views));
  std::vector<std::array<int, 3>> coarse_faces = surface.mesh.faces;
  const RayScene closed(surface.mesh);
  guided_depth(rig, closed, options.depth, points.background, result.depth);
  follow_depth(rig, result.depth.maps, options.fusion, surface);
  leave_unlit(rig, closed, result);
  result.depth.lights.clear();
  if (links.hand_on && !surface.mesh.faces.empty()) hand_on(links, std::move(coarse_faces), result);
  note_points_used(rig, points.points, result.depth.maps, surface);
}

/// Where the surface has to be for curves that deny it to lie on its lines.
std::vector<MeasuredPoint> denied_places(const Rig& rig, const PointResult& points) {
  Labeling labeling;
  for (const auto& denied : points.labeling.denied) {
    auto& runs = labeling.runs.emplace_back();
    for (const DeniedRun& run : denied) runs.push_back(run.predicted);
  }
  labeling.runs.resize(rig.cameras.size());
  return triangulate(rig, points.graphs, labeling, {});
}

/// Surface that none of the points lies near was not measured, nor was what curves deny.
void leave_unsupported(const Rig& rig, const PointResult& points, ShapeResult& result) {
  constexpr double kReach = 2;  // line spacings
  TriangleMesh& mesh = result.surface.mesh;
  const std::vector<char> unsupported =
      unsupported_vertices(rig, mesh, result.depth.maps, points.points, denied_places(rig, points),
                           kReach * line_spacing(rig));
  if (std::find(unsupported.begin(), unsupported.end(), 1) == unsupported.end()) return;
  give_reason(mesh, unsupported, HoleReason::kContradicted, result.holes);
  for (std::size_t v = 0; v < unsupported.size(); ++v) {
    if (unsupported[v] == 0) continue;
    mesh.confidence[v] = 0;
    mesh.hole[v] = static_cast<std::uint8_t>(HoleReason::kContradicted);
  }
}

void mark_holes(const Rig& rig, ShapeResult& result) {
  result.scene = std::make_shared<RayScene>(result.surface.mesh);
  result.holes = explain_holes(rig, *result.scene, result.depth.maps);
  give_reason(result.surface.mesh, result.unlit, HoleReason::kNoProjector, result.holes);
  for (const HoleReason reason : result.holes.vertices)
    result.surface.mesh.hole.push_back(static_cast<std::uint8_t>(reason));
}

}  // namespace

ShapeResult measure_shape(const Rig& rig, const Frame& frame, const PointResult& points,
                          const ShapeOptions& options, const FrameLinks& links,
                          const StageClock& clock) {
  ShapeResult result;
  if (options.depth.enabled) {
    clock("depth", [&] { result.depth = depth_of(rig, frame, points, options.depth); });
    if (!links.only_hands_on)
      clock("motion",
            [&] { result.motion = motion_in_exposure(rig, options.depth, result.depth); });
    std::vector<ColorView> views;
    clock("surface", [&] {
      views = color_views(rig, frame, points, result.depth.report);
      fuse(rig, points, views, options, links, result);
    });
    if (links.only_hands_on) return result;
    if (result.surface.report.status != SurfaceStatus::kTooFewPoints) {
      clock("holes", [&] { mark_holes(rig, result); });
      clock("color", [&] { result.surface.mesh.color = vertex_colors(rig, *result.scene, views); });
      return result;
    }
  }
  clock("surface",
        [&] { result.surface = reconstruct_surface(rig, points.points, options.surface); });
  if (options.depth.enabled) {
    Warning& warning = result.surface.report.warnings.emplace_back();
    warning.code = WarningCode::kCurvesOnly;
    warning.text = "dense depth found too little: the surface rests on the labelled curves alone";
  }
  return result;
}

FrameResult finish_shape(const Rig& rig, FrameResult result, const FusionOptions& options) {
  ShapeResult& shape = result.shape;
  if (!shape.scene) return result;  // a surface of curves alone is finished
  if (result.points.is_on_surface) leave_unsupported(rig, result.points, shape);
  if (!shape.steadied.empty()) shape.surface.mesh.vertices = std::move(shape.steadied);
  finish_surface(options, shape.surface);
  return result;
}

void scale_lengths(double factor, ShapeResult& shape) {
  const auto f = static_cast<float>(factor);
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
  ExposureMotion& motion = shape.motion;
  motion.shift *= factor;
  motion.pivot *= factor;
  for (double* length : {&motion.way, &motion.way_deviation, &motion.at_most}) *length *= factor;
}

}  // namespace pencilscan
