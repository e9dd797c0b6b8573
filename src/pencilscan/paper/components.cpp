#include "pencilscan/paper/components.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/parallel.h"
#include "pencilscan/paper/linear.h"
#include "pencilscan/paper/pencil_parameter.h"

namespace pencilscan {
namespace {

struct ComponentTask {
  std::size_t graph = 0;
  int component = 0;
};

struct ComponentResult {
  ComponentReport report;
  std::vector<std::pair<int, CurveLabel>> labels;  ///< (curve, label)
};

/// Rough probability that a linear solution's rounding picks the right line: the uncertainty along
/// e is the residual over the smallest singular value.
float linear_confidence(const LinearSolution& linear) {
  const double sigma_lines =
      std::max(0.1, linear.residual_rms_px) / std::max(1e-9, linear.sigma_min);
  return static_cast<float>(std::clamp(1 / (1 + sigma_lines), 0.0, 1.0));
}

CurveLabel continuous_label(const Rig& rig, const GridGraph& graph, int curve, double mu,
                            float confidence) {
  const CurveIdentity& identity = graph.identities[static_cast<std::size_t>(curve)];
  const Projector& projector = rig.projector(identity.pattern->projector);
  const LinePattern& pattern =
      projector.patterns[static_cast<std::size_t>(identity.pattern->pattern)];
  const PencilParameter parameter(rig, rig.camera(graph.camera), *identity.pattern);
  CurveLabel label;
  label.pattern = *identity.pattern;
  label.plane = parameter.line_from_mu(mu);
  label.line =
      nearest_line(label.plane, identity.local_id, pattern.period(), projector.line_count(pattern));
  label.confidence = confidence;
  return label;
}

ComponentResult solve_one(const Rig& rig, const GridGraph& graph, int component,
                          std::span<const CurveIndex> indices, const MultiviewOptions* options) {
  ComponentResult result;
  const LinearSolution linear = solve_component(rig, graph, component);
  if (linear.solved && options != nullptr) {
    const MultiviewSolution multiview = sweep_component(rig, graph, linear, indices, *options);
    result.report = multiview.report;
    if (multiview.report.sweep_cost.empty()) return result;
    const double scale = options->cost == MultiviewCost::kNormalized
                             ? 0.15 * options->search_radius_px
                             : std::max(1e-9, *std::min_element(multiview.report.sweep_cost.begin(),
                                                                multiview.report.sweep_cost.end()));
    const auto confidence =
        static_cast<float>(1 - 0.5 * std::exp(-multiview.report.margin / scale));
    for (std::size_t k = 0; k < linear.curves.size(); ++k) {
      if (multiview.lines[k] < 0) continue;
      const CurveIdentity& identity = graph.identities[static_cast<std::size_t>(linear.curves[k])];
      result.labels.push_back(
          {linear.curves[k], CurveLabel{*identity.pattern, multiview.lines[k],
                                        static_cast<double>(multiview.lines[k]), confidence}});
    }
  } else if (linear.solved) {
    for (std::size_t k = 0; k < linear.curves.size(); ++k) {
      const CurveLabel label =
          continuous_label(rig, graph, linear.curves[k], linear.mu[static_cast<Eigen::Index>(k)],
                           linear_confidence(linear));
      if (std::isfinite(label.plane) && label.line >= 0)
        result.labels.push_back({linear.curves[k], label});
    }
    result.report.solved = true;
  } else {
    result.report.reason = linear.reason;
  }
  result.report.camera = graph.camera;
  result.report.crossings = linear.crossings;
  result.report.curves = static_cast<int>(
      std::count(graph.component_of_curve.begin(), graph.component_of_curve.end(), component));
  result.report.sigma_min = linear.sigma_min;
  result.report.sigma_second = linear.sigma_second;
  result.report.residual_rms_px = linear.residual_rms_px;
  return result;
}

/// One component of one camera after the other; without options the linear solution stands.
Labeling solve_components(const Rig& rig, std::span<const GridGraph> graphs,
                          const MultiviewOptions* options) {
  Labeling labeling;
  labeling.runs.resize(rig.cameras.size());
  std::vector<ComponentTask> tasks;
  std::vector<CurveIndex> indices;
  indices.reserve(rig.cameras.size());
  std::vector<const GridGraph*> of_camera(rig.cameras.size(), nullptr);
  for (std::size_t g = 0; g < graphs.size(); ++g) {
    const auto camera = static_cast<std::size_t>(graphs[g].camera);
    of_camera[camera] = &graphs[g];
    for (int k = 0; k < graphs[g].component_count; ++k) tasks.push_back({g, k});
  }
  const GridGraph nothing;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    indices.emplace_back(of_camera[c] != nullptr ? *of_camera[c] : nothing,
                         cv::Size(rig.cameras[c].width, rig.cameras[c].height));
  }
  std::vector<ComponentResult> results(tasks.size());
  parallel_for(tasks.size(), [&](std::size_t t) {
    results[t] = solve_one(rig, graphs[tasks[t].graph], tasks[t].component, indices, options);
  });
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const GridGraph& graph = graphs[tasks[t].graph];
    auto& runs = labeling.runs[static_cast<std::size_t>(graph.camera)];
    for (const auto& [curve, label] : results[t].labels) {
      const auto points = graph.curves[static_cast<std::size_t>(curve)].points.size();
      runs.push_back({curve, 0, static_cast<int>(points), label});
    }
    labeling.components.push_back(std::move(results[t].report));
  }
  for (auto& runs : labeling.runs) {
    std::sort(runs.begin(), runs.end(),
              [](const LabeledRun& a, const LabeledRun& b) { return a.curve < b.curve; });
  }
  return labeling;
}

}  // namespace

Labeling solve_linear(const Rig& rig, std::span<const GridGraph> graphs) {
  return solve_components(rig, graphs, nullptr);
}

Labeling solve_multiview(const Rig& rig, std::span<const GridGraph> graphs,
                         const MultiviewOptions& options) {
  return solve_components(rig, graphs, &options);
}

Labeling solve_projector_grids(const Rig& rig, std::span<const GridGraph> graphs,
                               const SingleProjectorOptions& options) {
  Labeling labeling;
  labeling.runs.resize(rig.cameras.size());
  std::vector<std::vector<GridSolution>> solutions(graphs.size());
  parallel_for(graphs.size(),
               [&](std::size_t g) { solutions[g] = solve_grids(rig, graphs[g], options); });
  for (std::size_t g = 0; g < graphs.size(); ++g) {
    auto& runs = labeling.runs[static_cast<std::size_t>(graphs[g].camera)];
    for (GridSolution& solution : solutions[g]) {
      constexpr double kScale = 0.25;  // half a line, squared
      const auto confidence =
          static_cast<float>(1 - 0.5 * std::exp(-solution.report.margin / kScale));
      for (std::size_t k = 0; k < solution.lines.size(); ++k) {
        if (solution.lines[k] < 0) continue;
        const auto curve = static_cast<std::size_t>(solution.curves[k]);
        runs.push_back({solution.curves[k], 0,
                        static_cast<int>(graphs[g].curves[curve].points.size()),
                        CurveLabel{*graphs[g].identities[curve].pattern, solution.lines[k],
                                   static_cast<double>(solution.lines[k]), confidence}});
      }
      labeling.components.push_back(std::move(solution.report));
    }
    std::sort(runs.begin(), runs.end(),
              [](const LabeledRun& a, const LabeledRun& b) { return a.curve < b.curve; });
  }
  return labeling;
}

}  // namespace pencilscan
