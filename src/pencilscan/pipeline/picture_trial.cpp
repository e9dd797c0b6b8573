#include "pencilscan/pipeline/picture_trial.h"

#include "pencilscan/points/triangulate.h"

namespace pencilscan {

double named_share(const Labeling& labeling, std::size_t c) {
  const std::size_t named = labelled_points(labeling.runs[c]);
  const auto undecided = undecided_points(labeling.undecided[c], labeling.runs[c]);
  const std::size_t unnamed = undecided[static_cast<std::size_t>(UndecidedReason::kAmbiguous)] +
                              undecided[static_cast<std::size_t>(UndecidedReason::kContradicted)];
  if (named == 0) return 0;
  return static_cast<double>(named) / static_cast<double>(named + unnamed);
}

std::vector<MeasuredPoint> some_points(const Rig& rig, const std::vector<GridGraph>& graphs,
                                       const Labeling& labeling) {
  TriangulationOptions options;
  options.used_of_seven = 1;
  return triangulate(rig, graphs, labeling, options);
}

PictureTrial::PictureTrial(const Rig& rig, const PointOptions& options)
    : rig_(rig), options_(options) {
  for (Camera& camera : rig_.cameras) {
    camera.gamma = 1;
    camera.black_level = 0;
    camera.mosaic.reset();
  }
}

PictureTrial::Named PictureTrial::named(std::size_t c, const cv::Mat& light) const {
  const Labeling labeling = solved(c, light).labeling;
  return {static_cast<double>(labelled_points(labeling.runs[c])), named_share(labeling, c)};
}

std::vector<MeasuredPoint> PictureTrial::points(std::size_t c, const cv::Mat& light) const {
  const PointResult result = solved(c, light);
  return some_points(rig_, result.graphs, result.labeling);
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
