#include "pencilscan/api/stages.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "pencilscan/api/frame_input.h"
#include "pencilscan/api/run_stages.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/pipeline/curve_output.h"
#include "pencilscan/pipeline/sensor_frame.h"

namespace pencilscan {

struct DetectedFrame::Inner {
  Rig rig;
  Frame frame;         ///< with pictures of its own
  SensorFrame sensor;  ///< lengths in footprints
  PointResult found;
  CurveFile curves;
  std::vector<GridCurve> grid;
};

namespace {

/// Without labels, for what wants a labelling.
Labeling no_labels(std::size_t cameras) {
  Labeling labeling;
  labeling.runs.resize(cameras);
  labeling.tentative.resize(cameras);
  labeling.undecided.resize(cameras);
  return labeling;
}

std::vector<GridCurve> grid_of(const std::vector<GridGraph>& graphs) {
  std::vector<GridCurve> rows;
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    const GridGraph& graph = graphs[c];
    for (std::size_t k = 0; k < graph.curves.size(); ++k) {
      GridCurve& row = rows.emplace_back();
      row.camera = static_cast<std::uint8_t>(c);
      row.curve = static_cast<std::uint32_t>(k);
      row.component = graph.component_of_curve[k];
      if (graph.identities.empty() || !graph.identities[k].pattern) continue;
      const CurveIdentity& identity = graph.identities[k];
      row.projector = static_cast<std::int16_t>(identity.pattern->projector);
      row.pattern = static_cast<std::int16_t>(identity.pattern->pattern);
      row.local_id = identity.local_id;
      row.id_probability = identity.id_probability;
    }
  }
  return rows;
}

/// InputError when a label names no line of the rig.
void check_label(const Rig& rig, const PointLabel& label, std::size_t i) {
  const auto fail = [&](const char* field, int value, std::size_t count) {
    throw InputError("labels", std::string(field) + "[" + std::to_string(i) + "]",
                     std::to_string(value),
                     "must be in [0, " + std::to_string(count) + "), or projector -1 for none");
  };
  const auto is_outside = [](int value, std::size_t count) {
    return value < 0 || static_cast<std::size_t>(value) >= count;
  };
  if (is_outside(label.projector, rig.projectors.size()))
    fail("projector", label.projector, rig.projectors.size());
  const auto& patterns = rig.projector(label.projector).patterns;
  if (is_outside(label.pattern, patterns.size())) fail("pattern", label.pattern, patterns.size());
  const LinePattern& pattern = patterns[static_cast<std::size_t>(label.pattern)];
  const auto lines = static_cast<std::size_t>(rig.projector(label.projector).line_count(pattern));
  if (is_outside(label.line, lines)) fail("line", label.line, lines);
  if (!(label.confidence >= 0 && label.confidence <= 1))
    throw InputError("labels", "confidence[" + std::to_string(i) + "]",
                     std::to_string(label.confidence), "must be in [0, 1]");
}

bool is_same(const PointLabel& a, const PointLabel& b) {
  const bool same_plane = a.plane == b.plane || (std::isnan(a.plane) && std::isnan(b.plane));
  return a.projector == b.projector && a.pattern == b.pattern && a.line == b.line &&
         a.confidence == b.confidence && same_plane;
}

CurveLabel curve_label(const PointLabel& label) {
  return {{label.projector, label.pattern},
          label.line,
          std::isnan(label.plane) ? static_cast<double>(label.line) : label.plane,
          label.confidence};
}

/// Neighbours on a curve with the same label are one run.
Labeling labeling_of(const Rig& rig, const std::vector<GridGraph>& graphs,
                     std::span<const PointLabel> labels) {
  Labeling labeling = no_labels(graphs.size());
  std::size_t first = 0;  // of a curve's points among the labels
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    for (std::size_t k = 0; k < graphs[c].curves.size(); ++k) {
      const std::size_t count = graphs[c].curves[k].points.size();
      const std::span<const PointLabel> of_curve = labels.subspan(first, count);
      for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
        end = begin + 1;  // a confidence that is no number does not even equal itself
        while (end < count && is_same(of_curve[end], of_curve[begin])) ++end;
        if (of_curve[begin].projector < 0) continue;
        check_label(rig, of_curve[begin], first + begin);
        labeling.runs[c].push_back({static_cast<int>(k), static_cast<int>(begin),
                                    static_cast<int>(end), curve_label(of_curve[begin])});
      }
      first += count;
    }
  }
  return labeling;
}

std::vector<PointLabel> labels_of(const std::vector<GridGraph>& graphs, std::size_t samples,
                                  const Labeling& labeling) {
  std::vector<PointLabel> labels(samples);
  std::size_t first = 0;
  for (std::size_t c = 0; c < graphs.size(); ++c) {
    std::vector<std::size_t> begin;
    for (const Curve& curve : graphs[c].curves) {
      begin.push_back(first);
      first += curve.points.size();
    }
    for (const LabeledRun& run : labeling.runs[c]) {
      for (int i = run.begin; i < run.end; ++i) {
        labels[begin[static_cast<std::size_t>(run.curve)] + static_cast<std::size_t>(i)] = {
            static_cast<std::int16_t>(run.label.pattern.projector),
            static_cast<std::int16_t>(run.label.pattern.pattern), run.label.line,
            run.label.confidence, run.label.plane};
      }
    }
  }
  return labels;
}

}  // namespace

DetectedFrame::DetectedFrame(std::shared_ptr<const Inner> inner) : inner_(std::move(inner)) {}
const CurveFile& DetectedFrame::curves() const { return inner_->curves; }
const std::vector<GridCurve>& DetectedFrame::grid() const { return inner_->grid; }
const Rig& DetectedFrame::rig() const { return inner_->rig; }

DetectedFrame detect(const Rig& rig, const Images& images, const ReconstructionOptions& options,
                     bool identities) {
  FrameOptions how = frame_options(rig, options);
  // A method that needs them, for its needs alone.
  if (identities) how.points.method = MultiviewOptions{};
  auto inner = std::make_shared<DetectedFrame::Inner>();
  inner->rig = rig;
  inner->frame = frame_of(rig, images, options);
  for (auto* pictures : {&inner->frame.images, &inner->frame.plain})
    for (cv::Mat& picture : *pictures) picture = picture.clone();
  std::optional<ThreadLimit> limit;
  if (options.threads > 0) limit.emplace(options.threads);
  run_stages(options.progress, told_stages(), [&](const Progress& progress) {
    std::vector<StageTime> times;
    const StageClock clock(progress, times);
    inner->sensor = sensor_frame(in_footprints(rig), inner->frame);
    inner->found = detect_frame(inner->sensor.rig, inner->sensor.frame, how.points, clock);
  });
  inner->found.labeling = no_labels(rig.cameras.size());
  PointResult told = inner->found;
  restore_light(inner->sensor.frame, told);
  inner->curves = describe_curves(rig, told);
  inner->grid = grid_of(inner->found.graphs);
  return DetectedFrame(std::move(inner));
}

std::vector<PointLabel> label(const DetectedFrame& detected, const ReconstructionOptions& options) {
  const DetectedFrame::Inner& inner = detected.inner();
  const FrameOptions how = frame_options(inner.rig, options);
  const auto& graphs = inner.found.graphs;
  const bool has_identities = std::all_of(graphs.begin(), graphs.end(), [](const GridGraph& g) {
    return !g.identities.empty() || g.curves.empty();
  });
  if (solution_method(how.points.method).capabilities.needs_identities && !has_identities)
    throw InputError("options", "method", options.method,
                     "needs curves that were detected with identities");
  std::optional<ThreadLimit> limit;
  if (options.threads > 0) limit.emplace(options.threads);
  PointResult lines;
  run_stages(options.progress, told_stages(), [&](const Progress& progress) {
    std::vector<StageTime> times;
    const StageClock clock(progress, times);
    PointResult curves = check_pictures(inner.sensor.rig, inner.sensor.frame, inner.found);
    lines = solve_frame(inner.sensor.rig, inner.sensor.frame, std::move(curves), how.points, clock);
  });
  return labels_of(graphs, inner.curves.samples.size(), lines.labeling);
}

Reconstruction reconstruct(const DetectedFrame& detected, std::span<const PointLabel> labels,
                           const ReconstructionOptions& options) {
  const DetectedFrame::Inner& inner = detected.inner();
  const FrameOptions how = frame_options(inner.rig, options);
  if (labels.size() != inner.curves.samples.size())
    throw InputError(
        "labels", "", std::to_string(labels.size()),
        "must be " + std::to_string(inner.curves.samples.size()) + ", one for every curve point");
  Labeling labeling = labeling_of(inner.rig, inner.found.graphs, labels);
  std::optional<ThreadLimit> limit;
  if (options.threads > 0) limit.emplace(options.threads);
  Reconstruction result;
  run_stages(options.progress, told_stages(), [&](const Progress& progress) {
    std::vector<StageTime> times;
    FrameLinks links;
    links.progress = progress;
    PointResult lines = check_pictures(inner.sensor.rig, inner.sensor.frame, inner.found);
    for (std::size_t c = 0; c < lines.left_out.size(); ++c)
      if (lines.left_out[c] != 0) labeling.runs[c].clear();
    // Images of `found` stay as they are, whatever the stages do to theirs.
    for (CameraDetection& detection : lines.detections)
      for (cv::Mat& image : detection.presence) image = image.clone();
    lines.labeling = std::move(labeling);
    const StageClock clock(progress, times);
    FrameResult found =
        measure_frame(inner.sensor.rig, inner.sensor.frame, std::move(lines), how, links, clock);
    found = in_unit_of(inner.rig, std::move(found));
    result = reconstruction_of(inner.rig, inner.frame, std::move(found), options.depth_maps);
  });
  return result;
}

}  // namespace pencilscan
