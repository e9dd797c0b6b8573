#include "pencilscan/geometry/ray_scene.h"

#include <embree3/rtcore.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

/// Closest point of a triangle. Ericson, "Real-Time Collision Detection" (2005), section 5.1.5.
Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const double scale = 1 / (va + vb + vc);
  return a + ab * (vb * scale) + ac * (vc * scale);
}

/// Embree gives codes for what else would be an exception.
void throw_if_failed(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
  throw StageError("rays cannot be traced: Embree gives error " + std::to_string(error) +
                   ", for lack of memory or threads");
}

}  // namespace

struct RayScene::State {
  TriangleMesh mesh;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  double reach = 0;  ///< largest coordinate

  ~State() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  const Vec3& vertex(std::size_t face, std::size_t corner) const {
    return mesh.vertices[static_cast<std::size_t>(mesh.faces[face][corner])];
  }
};

RayScene::RayScene(const TriangleMesh& mesh) : state_(std::make_unique<State>()) {
  state_->mesh = mesh;
  for (const Vec3& v : mesh.vertices)
    state_->reach = std::max(state_->reach, v.lpNorm<Eigen::Infinity>());
  // One build thread: the tree, and with it the choice among equal hits, must not vary. Not by the
  // device's "threads=1", which holds oneTBB's limit for the whole process down while it lives.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  state_->device = rtcNewDevice(nullptr);
  throw_if_failed(state_->device);
  state_->scene = rtcNewScene(state_->device);
  rtcSetSceneFlags(state_->scene, RTC_SCENE_FLAG_ROBUST);
  // A tree by Morton codes is made in a fifth of the time of the best one, and our scenes live for
  // less than a second: measured over a whole frame, rays take no longer.
  rtcSetSceneBuildQuality(state_->scene, RTC_BUILD_QUALITY_LOW);
  if (!mesh.faces.empty()) {
    RTCGeometry geometry = rtcNewGeometry(state_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), mesh.vertices.size()));
    throw_if_failed(state_->device);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        vertices[3 * i + k] = static_cast<float>(mesh.vertices[i][static_cast<Eigen::Index>(k)]);
      }
    }
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), mesh.faces.size()));
    throw_if_failed(state_->device);
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        indices[3 * i + k] = static_cast<unsigned>(mesh.faces[i][k]);
      }
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_LOW);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(state_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(state_->scene);
  throw_if_failed(state_->device);
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

std::optional<RayScene::Hit> RayScene::first_hit(const Ray& ray, double max_distance) const {
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(ray.origin.x());
  query.ray.org_y = static_cast<float>(ray.origin.y());
  query.ray.org_z = static_cast<float>(ray.origin.z());
  query.ray.dir_x = static_cast<float>(ray.direction.x());
  query.ray.dir_y = static_cast<float>(ray.direction.y());
  query.ray.dir_z = static_cast<float>(ray.direction.z());
  query.ray.tfar = static_cast<float>(max_distance);
  query.ray.mask = ~0U;  // Debian's Embree is built with ray masks
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(state_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

  // Float hits are off by up to 1e-4 mm: intersect the plane of the face again in double.
  Hit hit;
  hit.face = query.hit.primID;
  const Vec3& a = state_->vertex(hit.face, 0);
  const Vec3& b = state_->vertex(hit.face, 1);
  const Vec3& c = state_->vertex(hit.face, 2);
  const Vec3 normal = (b - a).cross(c - a);
  const double along = normal.dot(ray.direction);
  hit.distance = std::abs(along) > 1e-12 * normal.norm() ? normal.dot(a - ray.origin) / along
                                                         : static_cast<double>(query.ray.tfar);
  hit.point = ray.origin + hit.distance * ray.direction;
  const double area2 = normal.squaredNorm();
  const double wb = (hit.point - a).cross(c - a).dot(normal) / area2;
  const double wc = (b - a).cross(hit.point - a).dot(normal) / area2;
  hit.barycentric = {1 - wb - wc, wb, wc};
  return hit;
}

bool RayScene::visible(const Vec3& from, const Vec3& to, double margin_mm) const {
  const Vec3 way = to - from;
  const double length = way.norm();
  if (length <= 2 * margin_mm) return true;
  const Vec3 direction = way / length;
  const Vec3 start = from + margin_mm * direction;
  RTCRay query{};
  query.org_x = static_cast<float>(start.x());
  query.org_y = static_cast<float>(start.y());
  query.org_z = static_cast<float>(start.z());
  query.dir_x = static_cast<float>(direction.x());
  query.dir_y = static_cast<float>(direction.y());
  query.dir_z = static_cast<float>(direction.z());
  query.tfar = static_cast<float>(length - 2 * margin_mm);
  query.mask = ~0U;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(state_->scene, &context, &query);
  return query.tfar >= 0;  // Embree sets it to -inf on a hit
}

std::optional<RayScene::Closest> RayScene::closest_point(const Vec3& point,
                                                         double max_distance) const {
  struct Query {
    const State* state;
    Vec3 point;
    Closest best;
    bool found = false;

    /// A little more than asked for, since the tree is in float: a few of its steps at the largest
    /// number that takes part. The callback compares in double.
    [[nodiscard]] float in_tree(double distance) const {
      constexpr double kSteps = 8 * std::numeric_limits<float>::epsilon();
      return static_cast<float>(
          distance + kSteps * (distance + state->reach + point.lpNorm<Eigen::Infinity>()));
    }
  } search{state_.get(), point, {max_distance, 0, Vec3::Zero()}, false};
  RTCPointQuery query{};
  query.x = static_cast<float>(point.x());
  query.y = static_cast<float>(point.y());
  query.z = static_cast<float>(point.z());
  query.radius = search.in_tree(max_distance);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(
      state_->scene, &query, &context,
      [](RTCPointQueryFunctionArguments* arguments) {
        auto& s = *static_cast<Query*>(arguments->userPtr);
        const std::size_t face = arguments->primID;
        const Vec3 candidate = closest_on_triangle(
            s.point, s.state->vertex(face, 0), s.state->vertex(face, 1), s.state->vertex(face, 2));
        const double distance = (candidate - s.point).norm();
        const bool better = distance < s.best.distance ||
                            (s.found && distance == s.best.distance && face < s.best.face);
        if (!better && !(distance <= s.best.distance && !s.found)) return false;
        s.best = {distance, face, candidate};
        s.found = true;
        arguments->query->radius = s.in_tree(distance);
        return true;
      },
      &search);
  if (!search.found) return std::nullopt;
  return search.best;
}

const TriangleMesh& RayScene::mesh() const { return state_->mesh; }

}  // namespace pencilscan
