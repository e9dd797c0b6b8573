#include "pencilscan/report/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pencilscan/core/parallel.h"
#include "pencilscan/io/image.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/report/shaded_view.h"

namespace pencilscan {
namespace {

struct Side {
  std::string name;
  Vec3 direction;  ///< towards the eye, world
};
/// The views of a sheet: four from a little above the horizon, one from above, one from below.
const std::vector<Side>& six_sides() {
  static const std::vector<Side> kSides = {{"from +x", {1, 0, 0.25}},  {"from +y", {0, 1, 0.25}},
                                           {"from -x", {-1, 0, 0.25}}, {"from -y", {0, -1, 0.25}},
                                           {"from above", {0, 0, 1}},  {"from below", {0, 0, -1}}};
  return kSides;
}

std::vector<std::string> side_names() {
  std::vector<std::string> names;
  for (const Side& side : six_sides()) names.push_back(side.name);
  return names;
}

Sphere sphere_around(const BoundingBox& box) {
  return {0.5 * (box.low + box.high), std::max(0.5 * (box.high - box.low).norm(), 1e-3)};
}

void add_overlays(const FrameResults& results, std::vector<Picture>& pictures) {
  const std::size_t count = std::min(results.images.size(), results.rig.cameras.size());
  for (std::size_t camera = 0; camera < count; ++camera) {
    if (results.images[camera].empty()) continue;
    for (const OverlayKey key : {OverlayKey::kLocalId, OverlayKey::kProjector}) {
      const bool by_id = key == OverlayKey::kLocalId;
      OverlayOptions options;
      options.key_name = by_id ? "local ID" : "projector";
      const auto curves = curves_of_points(results.rig, results.points, camera, key, results.used);
      pictures.push_back({results.rig.cameras[camera].name + (by_id ? "_local_id" : "_projector"),
                          draw_overlay(results.images[camera], curves, options)});
    }
  }
}

/// The 1st and 99th percentile box: a few wrong points must not shrink the picture.
BoundingBox robust_box(std::span<const Vec3> points) {
  BoundingBox box;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& p : points) values.push_back(p[axis]);
    std::sort(values.begin(), values.end());
    const double low = values[values.size() / 100];
    const double high = values[values.size() - 1 - values.size() / 100];
    const double margin = 0.05 * (high - low);
    box.low[axis] = low - margin;
    box.high[axis] = high + margin;
  }
  return box;
}

void add_point_sheet(const FrameResults& results, const PictureOptions& options,
                     std::vector<Picture>& pictures) {
  std::vector<Vec3> points;
  std::vector<Color> colors;
  for (const MeasuredPoint& p : results.points) {
    const Vec3 x(p.x, p.y, p.z);
    if (!x.allFinite()) continue;
    points.push_back(x);
    colors.push_back(categorical_color(p.projector));
  }
  if (points.empty()) return;
  const Sphere scene = sphere_around(robust_box(points));
  std::vector<cv::Mat> views(six_sides().size());
  parallel_for(views.size(), [&](std::size_t i) {
    const Device view = make_view(scene, six_sides()[i].direction, options.width, options.height);
    views[i] = point_view(points, colors, view, 0.0022 * scene.radius);
  });
  cv::Mat sheet = contact_sheet(views, side_names(), 3);
  std::vector<LegendEntry> entries;
  for (std::size_t k = 0; k < results.rig.projectors.size(); ++k) {
    entries.push_back({categorical_color(static_cast<int>(k)), results.rig.projectors[k].name});
  }
  cv::vconcat(sheet, legend_strip(entries, sheet.cols), sheet);
  pictures.push_back({"points", sheet});
}

std::vector<cv::Mat> six_views(const MeshPainter& painter, const Sphere& scene,
                               const ShadeOptions& shading, const PictureOptions& options) {
  std::vector<cv::Mat> views;
  for (const Side& side : six_sides()) {
    views.push_back(
        painter.draw(make_view(scene, side.direction, options.width, options.height), shading));
  }
  return views;
}

std::vector<Vec3> device_centers(const Rig& rig) {
  std::vector<Vec3> centers;
  for (const Camera& camera : rig.cameras) centers.push_back(camera.center());
  for (const Projector& projector : rig.projectors) centers.push_back(projector.center());
  return centers;
}

/// A view from above the ring in which no device stands before the object, filled by the devices.
Device scene_view(const Rig& rig, const Sphere& object, int width, int height) {
  constexpr int kDirections = 36;
  constexpr double kFill = 0.86;  // of the picture, by the devices' centres
  const std::vector<Vec3> centers = device_centers(rig);
  double reach = object.radius;
  for (const Vec3& c : centers) reach = std::max(reach, (c - object.center).norm());
  Device best;
  double best_gap = -1;
  for (int i = 0; i < kDirections; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / kDirections;
    Device view = make_view({object.center, reach},
                            Vec3(std::cos(azimuth), std::sin(azimuth), 0.75), width, height);
    const Vec2 middle = *view.project(object.center);
    double gap = std::numeric_limits<double>::infinity();
    double zoom = 0;
    for (const Vec3& c : centers) {
      const auto pixel = view.project(c);
      if (!pixel) continue;
      const Vec2 offset = *pixel - middle;
      gap = std::min(gap, offset.norm());
      zoom = std::max({zoom, 2 * std::abs(offset[0]) / width, 2 * std::abs(offset[1]) / height});
    }
    if (gap <= best_gap) continue;
    best_gap = gap;
    best = view;
    if (zoom > 0) best.K.topLeftCorner<2, 2>() *= kFill / zoom;
  }
  return best;
}

void add_mesh_sheets(const FrameResults& results, const PictureOptions& options,
                     std::vector<Picture>& pictures) {
  const TriangleMesh& mesh = *results.mesh;
  const MeshPainter painter(mesh);
  const Sphere object = sphere_around(bounding_box(mesh));
  pictures.push_back(
      {"shape", contact_sheet(six_views(painter, object, {}, options), side_names(), 3)});

  ShadeOptions among_devices;
  among_devices.devices = &results.rig;
  const Device view = scene_view(results.rig, object, 2 * options.width, options.height * 4 / 3);
  pictures.push_back({"scene", painter.draw(view, among_devices)});

  if (results.truth == nullptr || results.truth->faces.empty()) return;
  const RayScene truth(*results.truth);
  ShadeOptions by_distance;
  by_distance.vertex_colors = distance_colors(distances_to(truth, mesh), options.high_distance_mm);
  cv::Mat sheet = contact_sheet(six_views(painter, object, by_distance, options), side_names(), 3);
  cv::vconcat(sheet, color_bar("distance to the truth", options.high_distance_mm, sheet.cols),
              sheet);
  pictures.push_back({"distance", sheet});
}

}  // namespace

std::vector<Picture> make_pictures(const FrameResults& results, const PictureOptions& options) {
  std::vector<Picture> pictures;
  add_overlays(results, pictures);
  add_point_sheet(results, options, pictures);
  if (results.mesh != nullptr && !results.mesh->faces.empty()) {
    add_mesh_sheets(results, options, pictures);
  }
  return pictures;
}

void write_pictures(const std::filesystem::path& folder, std::span<const Picture> pictures) {
  parallel_for(pictures.size(), [&](std::size_t i) {
    write_image(folder / (pictures[i].name + ".png"), pictures[i].image);
  });
}

}  // namespace pencilscan
