#include "pencilscan/calibration/flat_scene.h"

namespace pencilscan {

FlatScene flat_scene(const CalibrationResult& result, const VerdictOptions& options) {
  FlatScene scene;
  double planar = 0;
  double all = 0;
  for (const PairGeometry& pair : result.pairs) {
    planar += pair.planar_share * static_cast<double>(pair.inliers);
    all += static_cast<double>(pair.inliers);
  }
  if (all > 0) scene.share = planar / all;
  scene.is_mostly_flat = scene.share >= options.mostly_planar_share;
  return scene;
}

std::string FlatScene::text() const {
  return "one plane explains " + share_text(share) +
         " of the correspondences, and every rig sees a plane alike";
}

std::string FlatScene::reason() const { return is_mostly_flat ? ": " + text() : ""; }

std::string FlatScene::advice(const std::string& usual) const {
  return is_mostly_flat ? std::string(kLeaveThePlane) + ", or give K" : usual;
}

}  // namespace pencilscan
