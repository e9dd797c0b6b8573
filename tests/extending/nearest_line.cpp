#include "extending/nearest_line.h"

#include <cmath>

#include "pencilscan/grid/line_candidates.h"

namespace pencilscan::example {
namespace {

/// The line of one curve, decided alone: of the lines with its local ID that meet the ray of its
/// middle in the volume, the one nearest to where surfaces usually are, half a radius before the
/// volume's centre. Nothing where the grid did not tell its pattern, or no line fits.
std::optional<CurveLabel> nearest_line_of(const Rig& rig, const Camera& camera, const Curve& curve,
                                          const CurveIdentity& identity) {
  if (!identity.pattern || identity.local_id < 0) return std::nullopt;
  const Sphere volume = working_volume(rig);
  const Vec2 middle = curve.points[curve.points.size() / 2].position.cast<double>();
  const auto range = depth_range(camera, volume, middle);
  if (!range) return std::nullopt;
  const double usual = (camera.device_from_world * volume.center).z() - 0.5 * volume.radius;
  const int period = rig.pattern(*identity.pattern).period();
  std::optional<CurveLabel> best;
  double least = 0;
  for (const LineCandidate& candidate :
       line_candidates(rig, camera, *range, *identity.pattern, middle)) {
    const double off = std::abs(candidate.depth - usual);
    if (candidate.line % period != identity.local_id || (best && off >= least)) continue;
    best = CurveLabel{*identity.pattern, candidate.line, static_cast<double>(candidate.line),
                      identity.id_probability};
    least = off;
  }
  return best;
}

Labeling solve_nearest_line(const Rig& rig, const std::vector<ColorFamily>& /*families*/,
                            std::span<const GridGraph> graphs, const MethodOptions& /*options*/) {
  Labeling labeling;
  labeling.runs.resize(rig.cameras.size());
  for (const GridGraph& graph : graphs) {
    auto& runs = labeling.runs[static_cast<std::size_t>(graph.camera)];
    for (std::size_t c = 0; c < graph.curves.size(); ++c) {
      const Curve& curve = graph.curves[c];
      const auto label = nearest_line_of(rig, rig.camera(graph.camera), curve, graph.identities[c]);
      if (label)
        runs.push_back({static_cast<int>(c), 0, static_cast<int>(curve.points.size()), *label});
    }
  }
  return labeling;
}

}  // namespace

const SolutionMethod kNearestLine{
    "nearest-line", {.needs_identities = true}, LinearOptions{}, solve_nearest_line};

}  // namespace pencilscan::example
