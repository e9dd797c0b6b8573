#include "pencilscan/pipeline/picture_trial.h"

#include "pencilscan/points/triangulate.h"

namespace pencilscan {

std::vector<MeasuredPoint> some_points(const Rig& rig, const PointResult& found) {
  TriangulationOptions options;
  options.used_of_seven = 1;
  return triangulate(rig, found.graphs, found.labeling, options);
}

PictureTrial::PictureTrial(const Rig& rig, const PointOptions& options)
    : rig_(rig), options_(options) {
  for (Camera& camera : rig_.cameras) {
    camera.gamma = 1;
    camera.black_level = 0;
    camera.mosaic.reset();
  }
}

TellingPoints PictureTrial::telling_points(std::size_t c, const cv::Mat& light) const {
  return pencilscan::telling_points(solved(c, light).labeling, c);
}

std::vector<MeasuredPoint> PictureTrial::points(std::size_t c, const cv::Mat& light) const {
  return some_points(rig_, solved(c, light));
}

PointResult PictureTrial::solved(std::size_t c, const cv::Mat& light) const {
  Frame frame;
  frame.images.resize(rig_.cameras.size());
  frame.images[c] = light;
  PointResult found = detect_frame(rig_, frame, options_);
  found.labeling =
      solution_method(options_.method).solve(rig_, found.families, found.graphs, options_.method);
  return found;
}

}  // namespace pencilscan
