#pragma once

// A small output folder for tests: a ball between two cameras and two projectors.

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/labeling/point_file.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan::sample {

inline Rig rig() {
  Rig rig;
  for (const double side : {-1.0, 1.0}) {
    const std::string number = std::to_string(rig.cameras.size());
    rig.cameras.push_back(device_at<Camera>({600, 120 * side, 60}, "cam" + number, 160, 120, 300));
    rig.projectors.push_back(
        device_at<Projector>({500, -200 * side, 0}, "proj" + number, 160, 120, 300));
    rig.projectors.back().patterns = {LinePattern{}};
  }
  rig.volume = Sphere{{0, 0, 0}, 120};
  return rig;
}

inline constexpr double kBallRadius = 90;  // mm

inline TriangleMesh ball() {
  TriangleMesh mesh = make_sphere(kBallRadius, 40);
  for (const Vec3& v : mesh.vertices) {
    const bool seen = v.x() > 0;
    mesh.sigma.push_back(0.05F);
    mesh.confidence.push_back(seen ? 0.9F : 0.0F);
    mesh.hole.push_back(seen ? 1 : 8);
  }
  return mesh;
}

/// Points of both cameras where their rays meet a ball `off_mm` larger than it is.
inline std::vector<MeasuredPoint> points(const Rig& rig, double off_mm = 0) {
  std::vector<MeasuredPoint> points;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    for (int line = 0; line < 8; ++line) {
      for (int v = 30; v < 90; ++v) {
        const double u = 50 + 7 * line;
        const Ray ray = rig.cameras[c].ray({u, static_cast<double>(v)});
        const double b = ray.origin.dot(ray.direction);
        const double radius = kBallRadius + off_mm;
        const double inside = b * b - ray.origin.squaredNorm() + radius * radius;
        if (inside <= 0) continue;
        const Vec3 x = ray.origin + (-b - std::sqrt(inside)) * ray.direction;
        MeasuredPoint point;
        point.x = static_cast<float>(x.x());
        point.y = static_cast<float>(x.y());
        point.z = static_cast<float>(x.z());
        point.u = static_cast<float>(u);
        point.v = static_cast<float>(v);
        point.camera = static_cast<std::uint8_t>(c);
        point.projector = static_cast<std::uint8_t>(line % 2);
        point.line = static_cast<std::uint16_t>(line);
        point.plane = static_cast<float>(line);
        point.sigma = 0.1F;
        point.confidence = 0.99F;
        points.push_back(point);
      }
    }
  }
  return points;
}

/// One frame's folder with everything that reconstruct writes and the page reads.
inline void write_frame(const std::filesystem::path& folder, const Rig& rig) {
  const auto measured = points(rig);
  write_points(folder / "points.ply", measured);
  write_mesh(folder / "mesh.ply", ball());
  write_mesh(folder / "mesh_measured.ply", ball());
  CurveFile curves;
  for (const MeasuredPoint& p : measured) {
    CurveSample sample;
    sample.u = p.u;
    sample.v = p.v;
    sample.camera = p.camera;
    sample.curve = p.line;
    sample.state = CurveState::kLabelled;
    sample.projector = p.projector;
    sample.line = p.line;
    sample.confidence = p.confidence;
    curves.samples.push_back(sample);
  }
  curves.crossings.push_back({80, 60, 0, 1, 2});
  write_curves(folder / "curves.ply", curves);
  for (const Camera& camera : rig.cameras) {
    const cv::Mat image(camera.height, camera.width, CV_8UC3, cv::Scalar(40, 60, 200));
    write_image(folder / "pictures" / (camera.name + ".jpg"), image);
    const cv::Mat holes(camera.height + 28, camera.width, CV_8UC3, cv::Scalar(225, 225, 225));
    write_image(folder / "pictures" / (camera.name + "_holes.png"), holes);
  }
  write_json(folder / "timing.json",
             {{"threads", 2}, {"seconds", {{"grid", 0.5}, {"total", 1.5}}}});
  write_json(folder / "report.json",
             {{"frame", folder.filename().string()},
              {"points", measured.size()},
              {"surface", {{"measured_share", 0.5}}},
              {"warnings", {"camera cam0: 3 % of its pixels are saturated; lower exposure"}},
              {"findings",
               {{{"code", "saturated"},
                 {"device", "cam0"},
                 {"text", "camera cam0: 3 % of its pixels are saturated; lower exposure"}}}}});
}

/// An output folder with frames 000000, 000001, ...
inline void write_output(const std::filesystem::path& root, int frames) {
  const Rig devices = rig();
  write_json(root / "inputs.json", {{"rig", "0"}});
  write_rig(devices, root / "devices.json");
  for (int i = 0; i < frames; ++i) {
    std::string name = std::to_string(i);
    write_frame(root / (std::string(6 - name.size(), '0') + name), devices);
  }
}

}  // namespace pencilscan::sample
