#include "pencilscan/surface/node_samples.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/median.h"
#include "pencilscan/depth/consistency.h"

namespace pencilscan {

std::vector<SurfaceSample> node_samples(const Rig& rig, std::span<const DepthMap> maps,
                                        double& spacing) {
  constexpr double kLeastCosine = 0.7;  // stretches the spacing of grazing nodes no further
  constexpr double kLeastSigma = 0.01;  // footprints; keeps one node from ruling its neighbours
  std::vector<SurfaceSample> samples;
  std::vector<double> spacings;
  for (const DepthMap& map : maps) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
    for (std::size_t i = 0; i < map.nodes.size(); ++i) {
      const DepthNode& node = map.nodes[i];
      if (!node.measured()) continue;
      SurfaceSample s;
      s.position = node_point(rig, map, i);
      s.normal = node_normal(rig, map, i);
      s.to_camera = (camera.center() - s.position).normalized();
      s.sheet_normal = s.normal.unitOrthogonal();
      s.sigma = std::max(static_cast<double>(node.sigma), kLeastSigma);
      s.confidence = static_cast<double>(node.confidence);
      s.camera = static_cast<std::uint8_t>(map.camera);
      s.count = 1;
      const double depth = 1 / static_cast<double>(node.w);
      s.spacing =
          map.stride * depth / camera.K(0, 0) / std::max(s.normal.dot(s.to_camera), kLeastCosine);
      spacings.push_back(s.spacing);
      samples.push_back(s);
    }
  }
  spacing = upper_median(std::move(spacings));
  return samples;
}

}  // namespace pencilscan
