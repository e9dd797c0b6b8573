// How far a calibrated rig lies from the true one, free of gauge:
//   calibration_accuracy <true rig.json> <found rig.json>
// Points all over the working volume are projected into all devices of the true rig and measured
// with the found one; one similarity takes the points there; then both rigs' projections are
// compared.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/triangulation.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/least_squares.h"
#include "pencilscan/rig/device_list.h"

namespace {

using namespace pencilscan;

constexpr std::size_t kPoints = 500;

std::vector<Vec3> points_in(const Sphere& volume) {
  Random random(1);
  std::vector<Vec3> points;
  while (points.size() < kPoints) {
    const Vec3 x(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    if (x.norm() <= 1) points.push_back(volume.center + volume.radius * x);
  }
  return points;
}

void require_same_devices(const Rig& truth, const Rig& found, const std::string& source) {
  bool is_same = truth.cameras.size() == found.cameras.size() &&
                 truth.projectors.size() == found.projectors.size();
  for (std::size_t d = 0; is_same && d < device_count(truth); ++d)
    is_same = device_at(truth, d).name == device_at(found, d).name;
  if (!is_same)
    throw InputError(source, "devices", std::to_string(device_count(found)),
                     "must be those of the true rig, in its order");
}

void compare(const Rig& truth, const Rig& found) {
  BundleProblem problem;
  for (std::size_t d = 0; d < device_count(found); ++d) {
    problem.devices.push_back(bundle_device(device_at(found, d)));
    problem.devices.back().present = true;
  }
  std::vector<Vec3> points;
  std::vector<Vec3> measured;
  for (const Vec3& x : points_in(working_volume(truth))) {
    Track track;
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      const auto pixel = device_at(truth, d).project(x);
      if (pixel && device_at(truth, d).contains(*pixel)) track.views.push_back({d, *pixel, 1});
    }
    const auto y = triangulate(problem, track, 0.01);
    if (!y) continue;
    points.push_back(x);
    measured.push_back(*y);
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::Matrix3Xd a(3, n);
  Eigen::Matrix3Xd b(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    a.col(i) = points[static_cast<std::size_t>(i)];
    b.col(i) = measured[static_cast<std::size_t>(i)];
  }
  const Eigen::Matrix4d S = fit_similarity(a, b, true);
  std::vector<double> errors;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec3 moved = (S * a.col(i).homogeneous()).head<3>();
    for (std::size_t d = 0; d < device_count(truth); ++d) {
      const auto p = device_at(truth, d).project(a.col(i));
      const auto q = device_at(found, d).project(moved);
      if (p && q && device_at(truth, d).contains(*p)) errors.push_back((*p - *q).norm());
    }
  }
  std::sort(errors.begin(), errors.end());
  double focal = 0;
  for (std::size_t d = 0; d < device_count(truth); ++d) {
    const double error = device_at(found, d).K(0, 0) / device_at(truth, d).K(0, 0) - 1;
    focal = std::max(focal, std::abs(error));
  }
  std::printf("points                %zu\n", points.size());
  std::printf("scale                 %.6f\n", S.block<3, 1>(0, 0).norm());
  std::printf("focal_error_worst     %.4f %%\n", 100 * focal);
  if (errors.empty()) return;
  std::printf("projection_median_px  %.4f\n", errors[errors.size() / 2]);
  std::printf("projection_p95_px     %.4f\n", errors[errors.size() * 95 / 100]);
  std::printf("projection_max_px     %.4f\n", errors.back());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: calibration_accuracy <true rig.json> <found rig.json>\n");
    return 2;
  }
  try {
    const Rig truth = read_rig(argv[1]);
    const Rig found = read_rig(argv[2]);
    require_same_devices(truth, found, argv[2]);
    compare(truth, found);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "calibration_accuracy: %s\n", error.what());
    return 1;
  }
  return 0;
}
