#include "pencilscan/simulation/truth.h"

#include <cstdint>
#include <limits>

#include "pencilscan/core/parallel.h"
#include "pencilscan/simulation/tracer.h"

namespace pencilscan {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

void fill_projector(const Projector& projector, const Vec3& center, const SimulatedObject& object,
                    const SightedPoint& sample, int x, int y, ProjectorTruth& truth) {
  truth.cosine.at<float>(y, x) =
      static_cast<float>((center - sample.point).normalized().dot(sample.face_normal));
  const auto pixel = panel_pixel(projector, projector.device_from_world * sample.point);
  if (!pixel) return;
  for (std::size_t i = 0; i < projector.patterns.size(); ++i) {
    const LinePattern& pattern = projector.patterns[i];
    truth.line[i].at<double>(y, x) =
        pattern.coordinate((*pixel)[static_cast<Eigen::Index>(pattern.axis)]);
  }
  truth.lit.at<std::uint8_t>(y, x) = object.lit(sample.point, sample.face_normal, center) ? 1 : 0;
}

}  // namespace

CameraTruth camera_truth(const Rig& rig, std::size_t camera_index, const SimulatedObject& object) {
  const Camera& camera = rig.cameras[camera_index];
  const cv::Size size(camera.width, camera.height);
  CameraTruth truth;
  truth.depth = cv::Mat(size, CV_64F, cv::Scalar(kNone));
  truth.cosine = cv::Mat(size, CV_32F, cv::Scalar(kNone));
  std::vector<Vec3> centers;
  for (const Projector& projector : rig.projectors) {
    ProjectorTruth& p = truth.projectors.emplace_back();
    for (std::size_t i = 0; i < projector.patterns.size(); ++i) {
      p.line.emplace_back(size, CV_64F, cv::Scalar(kNone));
    }
    p.lit = cv::Mat(size, CV_8U, cv::Scalar(0));
    p.cosine = cv::Mat(size, CV_32F, cv::Scalar(kNone));
    centers.push_back(projector.center());
  }
  const CameraTracer tracer(camera, object);
  parallel_for(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      if (!tracer.may_hit(x, y)) continue;
      const auto sample = tracer.trace(Vec2(x, y));
      if (!sample) continue;
      truth.depth.at<double>(y, x) = sample->depth;
      truth.cosine.at<float>(y, x) = static_cast<float>(sample->to_camera.dot(sample->face_normal));
      for (std::size_t p = 0; p < centers.size(); ++p) {
        fill_projector(rig.projectors[p], centers[p], object, *sample, x, y, truth.projectors[p]);
      }
    }
  });
  return truth;
}

}  // namespace pencilscan
