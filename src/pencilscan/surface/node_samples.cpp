#include "pencilscan/surface/node_samples.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/median.h"
#include "pencilscan/depth/consistency.h"

namespace pencilscan {

namespace {

SurfaceSample sample_of(const Rig& rig, const DepthMap& map, std::size_t i) {
  constexpr double kLeastCosine = 0.7;  // stretches the spacing of grazing nodes no further
  constexpr double kLeastSigma = 0.01;  // footprints; keeps one node from ruling its neighbours
  const Camera& camera = rig.cameras[static_cast<std::size_t>(map.camera)];
  const DepthNode& node = map.nodes[i];
  SurfaceSample s;
  s.position = node_point(rig, map, i);
  s.normal = node_normal(rig, map, i);
  s.to_camera = (camera.center() - s.position).normalized();
  s.sheet_normal = s.normal.unitOrthogonal();
  s.sigma = std::max(static_cast<double>(node.sigma), kLeastSigma);
  s.confidence = static_cast<double>(node.confidence);
  s.curve = static_cast<std::uint32_t>(i);
  s.camera = static_cast<std::uint8_t>(map.camera);
  s.count = 1;
  const double depth = 1 / static_cast<double>(node.w);
  s.spacing =
      map.stride * depth / camera.focal_px() / std::max(s.normal.dot(s.to_camera), kLeastCosine);
  return s;
}

}  // namespace

std::vector<SurfaceSample> node_samples(const Rig& rig, std::span<const DepthMap> maps,
                                        double& spacing) {
  std::vector<SurfaceSample> samples;
  add_node_samples(rig, maps, samples);
  std::vector<double> spacings;
  for (const SurfaceSample& s : samples) spacings.push_back(s.spacing);
  spacing = upper_median(std::move(spacings));
  return samples;
}

void add_node_samples(const Rig& rig, std::span<const DepthMap> maps,
                      std::vector<SurfaceSample>& samples) {
  std::vector<std::vector<char>> is_missing(maps.size());
  std::vector<std::size_t> map_of(rig.cameras.size(), 0);
  for (std::size_t k = 0; k < maps.size(); ++k) {
    map_of[static_cast<std::size_t>(maps[k].camera)] = k;
    for (const DepthNode& node : maps[k].nodes) is_missing[k].push_back(node.measured() ? 1 : 0);
  }
  for (const SurfaceSample& s : samples) is_missing[map_of[s.camera]][s.curve] = 0;
  std::vector<std::pair<std::size_t, std::size_t>> missing;  // map, node
  for (std::size_t k = 0; k < maps.size(); ++k) {
    for (std::size_t i = 0; i < is_missing[k].size(); ++i) {
      if (is_missing[k][i] != 0) missing.emplace_back(k, i);
    }
  }
  const std::size_t before = samples.size();
  samples.resize(before + missing.size());
  parallel_chunks(missing.size(), [&](std::size_t m) {
    samples[before + m] = sample_of(rig, maps[missing[m].first], missing[m].second);
  });
}

}  // namespace pencilscan
