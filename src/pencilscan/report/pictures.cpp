#include "pencilscan/report/pictures.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/io/image.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/report/shaded_view.h"

namespace pencilscan {
namespace {

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
  std::vector<cv::Mat> views;
  for (const Side& side : six_sides()) {
    const Device view = make_view(scene, side.direction, options.width, options.height);
    views.push_back(point_view(points, colors, view, 0.0022 * scene.radius));
  }
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

void add_mesh_sheets(const FrameResults& results, const PictureOptions& options,
                     std::vector<Picture>& pictures) {
  const TriangleMesh& mesh = *results.mesh;
  const MeshPainter painter(mesh);
  const Sphere object = sphere_around(bounding_box(mesh));
  pictures.push_back(
      {"shape", contact_sheet(six_views(painter, object, {}, options), side_names(), 3)});

  BoundingBox devices{object.center, object.center};
  const auto include = [&](const Device& device) {
    devices.low = devices.low.cwiseMin(device.center());
    devices.high = devices.high.cwiseMax(device.center());
  };
  for (const Camera& camera : results.rig.cameras) include(camera);
  for (const Projector& projector : results.rig.projectors) include(projector);
  Sphere all = sphere_around(devices);
  all.radius = std::max(0.86 * all.radius, object.radius);
  ShadeOptions shading;
  shading.devices = &results.rig;
  const Device view =
      make_view(all, Vec3(1, -0.55, 0.62), 2 * options.width, 2 * options.height * 3 / 4);
  pictures.push_back({"scene", painter.draw(view, shading)});

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

const std::vector<Side>& six_sides() {
  static const std::vector<Side> kSides = {{"from +x", {1, 0, 0.25}},  {"from +y", {0, 1, 0.25}},
                                           {"from -x", {-1, 0, 0.25}}, {"from -y", {0, -1, 0.25}},
                                           {"from above", {0, 0, 1}},  {"from below", {0, 0, -1}}};
  return kSides;
}

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
  for (const Picture& picture : pictures) {
    write_image(folder / (picture.name + ".png"), picture.image);
  }
}

}  // namespace pencilscan
