#include "pencilscan/simulation/tracer.h"

#include <algorithm>
#include <cmath>

namespace pencilscan {

CameraTracer::CameraTracer(const Device& camera, const SimulatedObject& object)
    : camera_(&camera),
      object_(&object),
      center_(camera.center()),
      world_from_camera_(camera.device_from_world.rotation.transpose()) {
  mark_tiles();
}

void CameraTracer::mark_tiles() {
  tiles_across_ = static_cast<std::size_t>(camera_->width / kTile + 1);
  const auto tiles_down = static_cast<std::size_t>(camera_->height / kTile + 1);
  tiles_.assign(tiles_across_ * tiles_down, 0);
  constexpr double kMargin = 2;      // px: sub-pixel samples, chords of distorted edges
  constexpr int kEdgeSegments = 16;  // lens distortion bends edges: follow them
  const TriangleMesh& mesh = object_->mesh();
  const int segments = camera_->has_distortion() ? kEdgeSegments : 1;
  for (const auto& face : mesh.faces) {
    Vec2 low = Vec2::Constant(1e9);
    Vec2 high = Vec2::Constant(-1e9);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& a = mesh.vertices[static_cast<std::size_t>(face[k])];
      const Vec3& b = mesh.vertices[static_cast<std::size_t>(face[(k + 1) % 3])];
      for (int s = 0; s < segments; ++s) {
        const auto pixel = camera_->project(a + static_cast<double>(s) / segments * (b - a));
        if (!pixel) {  // reaches behind the camera: anything may be covered
          std::fill(tiles_.begin(), tiles_.end(), std::uint8_t{1});
          return;
        }
        low = low.cwiseMin(*pixel);
        high = high.cwiseMax(*pixel);
      }
    }
    const auto tile = [](double px, int size) {
      return static_cast<std::size_t>(std::clamp(px, 0.0, size - 1.0)) / kTile;
    };
    low.array() -= kMargin;
    high.array() += kMargin;
    if (high.x() < 0 || high.y() < 0 || low.x() > camera_->width || low.y() > camera_->height) {
      continue;
    }
    for (std::size_t y = tile(low.y(), camera_->height); y <= tile(high.y(), camera_->height);
         ++y) {
      for (std::size_t x = tile(low.x(), camera_->width); x <= tile(high.x(), camera_->width);
           ++x) {
        tiles_[y * tiles_across_ + x] = 1;
      }
    }
  }
}

std::optional<SightedPoint> CameraTracer::trace(const Vec2& pixel) const {
  const Vec3 direction = world_from_camera_ * camera_->normalized_from_pixel(pixel).homogeneous();
  const double length = direction.norm();
  const auto hit = object_->rays().first_hit({center_, direction / length});
  if (!hit) return std::nullopt;
  SightedPoint sample;
  sample.point = hit->point;
  sample.depth = hit->distance / length;  // the direction has z = 1 in the camera
  sample.to_camera = -direction / length;
  const auto normals = object_->normals_at(*hit, direction);
  sample.face_normal = normals.face;
  sample.normal = normals.shading;
  // d(point) for a pixel step: depth * (d(direction) slid along the ray onto the tangent plane).
  // Lens distortion changes the footprint by a few percent only and is left out of it.
  const double facing = sample.face_normal.dot(direction);
  const auto on_plane = [&](const Vec3& step) -> Vec3 {
    return sample.depth * (step - direction * (sample.face_normal.dot(step) / facing));
  };
  sample.across = on_plane(world_from_camera_.col(0) / camera_->K(0, 0));
  sample.down = on_plane(world_from_camera_.col(1) / camera_->K(1, 1));
  return sample;
}

std::optional<Vec2> panel_pixel(const Device& projector, const Vec3& x) {
  if (!(x.z() > 0)) return std::nullopt;
  const Vec2 pixel = projector.pixel_from_device(x);
  if (!projector.contains(pixel)) return std::nullopt;
  if (projector.has_distortion()) {
    // The other direction of a pixel is tens of degrees off: a thousandth is far above what the
    // inverse leaves and far below that.
    constexpr double kSame = 1e-3;
    const Vec2 direction = x.head<2>() / x.z();
    if (!((projector.normalized_from_pixel(pixel) - direction).norm() < kSame)) return std::nullopt;
  }
  return pixel;
}

std::optional<Incidence> incidence(const Device& projector, const Vec3& center,
                                   const SightedPoint& sample) {
  Incidence light;
  const Vec3 way = center - sample.point;
  light.distance = way.norm();
  light.to_light = way / light.distance;
  if (light.to_light.dot(sample.face_normal) <= 0) return std::nullopt;
  light.cosine = light.to_light.dot(sample.normal);
  if (light.cosine <= 0) return std::nullopt;
  const Vec3 x = projector.device_from_world * sample.point;
  const auto pixel = panel_pixel(projector, x);
  if (!pixel) return std::nullopt;
  light.pixel = *pixel;
  const Mat3& R = projector.device_from_world.rotation;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const Vec3 gradient =
        (projector.K(axis, axis) / x.z()) * (R.row(axis) - x[axis] / x.z() * R.row(2)).transpose();
    light.footprint_px[axis] = std::hypot(gradient.dot(sample.across), gradient.dot(sample.down));
  }
  return light;
}

}  // namespace pencilscan
