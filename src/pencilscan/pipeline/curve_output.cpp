#include "pencilscan/pipeline/curve_output.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "pencilscan/core/chunks.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/srgb.h"
#include "pencilscan/report/overlay.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

CurveState state_of(UndecidedReason reason) {
  switch (reason) {
    case UndecidedReason::kNoCrossing:
      return CurveState::kNoCrossing;
    case UndecidedReason::kAmbiguous:
      return CurveState::kAmbiguous;
    case UndecidedReason::kContradicted:
      return CurveState::kContradicted;
    case UndecidedReason::kOutsideVolume:
      return CurveState::kOutsideVolume;
  }
  return CurveState::kUndecided;
}

/// Likeliest colour of one point and its lead over the next one.
void put_color(const Curve& curve, std::size_t i, CurveSample& sample) {
  const std::size_t colors = curve.points.empty() ? 0 : curve.code.size() / curve.points.size();
  if (colors < 2) return;
  const auto first = curve.code.begin() + static_cast<std::ptrdiff_t>(i * colors);
  const auto last = first + static_cast<std::ptrdiff_t>(colors);
  const auto best = std::max_element(first, last);
  float next = -1e30F;
  for (auto it = first; it != last; ++it) {
    if (it != best) next = std::max(next, *it);
  }
  sample.color = static_cast<std::uint8_t>(best - first);
  sample.color_lead = std::min(*best - next, 1e6F);
}

/// The points of one camera's curves; `begin[k]` is where curve k starts.
void add_samples(const GridGraph& graph, std::uint8_t camera, std::vector<CurveSample>& samples,
                 std::vector<std::size_t>& begin) {
  for (std::size_t k = 0; k < graph.curves.size(); ++k) {
    begin.push_back(samples.size());
    const Curve& curve = graph.curves[k];
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      CurveSample sample;
      sample.u = curve.points[i].position.x();
      sample.v = curve.points[i].position.y();
      sample.sigma_px = curve.points[i].sigma_px;
      sample.amplitude = curve.points[i].amplitude;
      sample.camera = camera;
      sample.curve = static_cast<std::uint32_t>(k);
      sample.family = static_cast<std::uint8_t>(curve.family);
      put_color(curve, i, sample);
      samples.push_back(sample);
    }
  }
}

/// As a screen shows it: of the label's line, or grey.
void put_look(const Rig& rig, CurveSample& sample) {
  constexpr Rgb kGrey = {0.2, 0.2, 0.2};
  const Rgb light = sample.state == CurveState::kLabelled
                        ? rig.pattern({sample.projector, sample.pattern}).color(sample.line)
                        : kGrey;
  sample.red = to_srgb_byte(light[0]);
  sample.green = to_srgb_byte(light[1]);
  sample.blue = to_srgb_byte(light[2]);
}

/// Where a camera's ray meets its standing picture, `depth` before it.
void put_place(const Camera& camera, double depth, CurveSample& sample) {
  const Ray ray = camera.ray(Vec2(static_cast<double>(sample.u), static_cast<double>(sample.v)));
  const double along_axis = camera.forward().dot(ray.direction);
  const Vec3 x = ray.origin + depth / along_axis * ray.direction;
  sample.x = static_cast<float>(x.x());
  sample.y = static_cast<float>(x.y());
  sample.z = static_cast<float>(x.z());
}

void put_looks(const Rig& rig, std::vector<CurveSample>& samples) {
  constexpr double kLeastShare = 0.5;  // of the way to the centre, for cameras near the volume
  const Sphere volume = working_volume(rig);
  std::vector<double> depths;
  for (const Camera& camera : rig.cameras) {
    const double center = camera.forward().dot(volume.center - camera.center());
    depths.push_back(std::max(center - volume.radius, kLeastShare * std::abs(center)));
  }
  parallel_chunks(samples.size(), [&](std::size_t i) {
    CurveSample& sample = samples[i];
    put_look(rig, sample);
    put_place(rig.cameras[sample.camera], depths[sample.camera], sample);
  });
}

}  // namespace

CurveFile describe_curves(const Rig& rig, const PointResult& points) {
  CurveFile file;
  for (std::size_t c = 0; c < points.graphs.size(); ++c) {
    const GridGraph& graph = points.graphs[c];
    const auto camera = static_cast<std::uint8_t>(c);
    std::vector<std::size_t> begin;
    add_samples(graph, camera, file.samples, begin);
    const auto stretch = [&](int curve, int first, int last) {
      CurveSample* start = file.samples.data() + begin[static_cast<std::size_t>(curve)];
      return std::span(start + first, start + last);
    };
    if (c < points.labeling.undecided.size()) {
      for (const UndecidedRun& run : points.labeling.undecided[c]) {
        for (CurveSample& s : stretch(run.curve, run.begin, run.end))
          s.state = state_of(run.reason);
      }
    }
    for (const LabeledRun& run : points.labeling.runs[c]) {
      for (CurveSample& s : stretch(run.curve, run.begin, run.end)) {
        s.state = CurveState::kLabelled;
        s.projector = static_cast<std::uint8_t>(run.label.pattern.projector);
        s.pattern = static_cast<std::uint8_t>(run.label.pattern.pattern);
        s.line = static_cast<std::uint16_t>(run.label.line);
        s.confidence = run.label.confidence;
      }
    }
    for (const Crossing& crossing : graph.crossings) {
      file.crossings.push_back({crossing.position.x(), crossing.position.y(), camera,
                                static_cast<std::uint32_t>(crossing.curve_a),
                                static_cast<std::uint32_t>(crossing.curve_b)});
    }
  }
  put_looks(rig, file.samples);
  return file;
}

void write_camera_pictures(const std::filesystem::path& folder, const Rig& rig,
                           const Frame& frame) {
  parallel_for(rig.cameras.size(), [&](std::size_t c) {
    if (frame.images[c].empty()) return;
    const cv::Mat linear = linear_light(rig.cameras[c], frame.images[c]);
    write_image(folder / (rig.cameras[c].name + ".jpg"), displayable(linear));
  });
}

}  // namespace pencilscan
