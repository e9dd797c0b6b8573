#include "pencilscan/pipeline/coarse_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "pencilscan/core/parallel.h"
#include "pencilscan/depth/wide_windows.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/rig/binning.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// A colour is the mean of its own samples: a mosaic's colours have their middles where the pixel
/// has its own, and nothing is filled in.
cv::Mat binned_samples(const cv::Mat& light, const Mosaic& mosaic, int binning) {
  std::array<cv::Mat, 3> colors;
  for (int k = 0; k < 3; ++k) {
    cv::Mat is_sample(light.size(), CV_32FC1);
    for (int y = 0; y < light.rows; ++y) {
      auto* row = is_sample.ptr<float>(y);
      for (int x = 0; x < light.cols; ++x) row[x] = mosaic.color(x, y) == k ? 1.F : 0.F;
    }
    colors[static_cast<std::size_t>(k)] = binned(light, is_sample, binning);
  }
  cv::Mat result;
  cv::merge(colors.data(), colors.size(), result);
  return result;
}

/// Linear light, of the full range where any of the pixels is overexposed.
cv::Mat binned_light(const Camera& camera, const cv::Mat& stored, int binning) {
  const cv::Mat values = camera_values(camera, stored);
  cv::Mat light = camera.mosaic
                      ? binned_samples(linearized(values, camera.gamma, camera.black_level),
                                       *camera.mosaic, binning)
                      : binned(linear_light(camera, values), binning);
  cv::Mat exposed;
  overexposed(values).convertTo(exposed, CV_32F);
  light.setTo(cv::Scalar::all(1), binned(exposed, binning) > 0);
  return light;
}

double width_px(int half) { return 2 * half + 1; }

/// Of n x n pixels that are one, noise falls to the n-th part, and the best radius of a window to
/// its fifth root of that (options_for()). Nodes stay the same share of a window apart.
DepthOptions of_joined(double n, DepthOptions options) {
  const double before = width_px(options.half);
  const double width = before * std::pow(n, -0.2);
  options.half = std::max(2, static_cast<int>(std::lround((width - 1) / 2)));
  // Even: wider windows beside these need an even number.
  const double stride = options.stride * width_px(options.half) / before;
  options.stride = std::max(2, 2 * static_cast<int>(std::lround(stride / 2)));
  return options;
}

/// `whole` and `part` of the way from one point to the next.
template <class Value>
Value between(const Value& a, const Value& b, int part, int whole) {
  const float share = static_cast<float>(part) / static_cast<float>(whole);
  return a + share * (b - a);
}

Curve fine_curve(const Curve& curve, int n) {
  Curve fine;
  fine.family = curve.family;
  const std::size_t count = curve.points.size();
  const std::size_t colors = count == 0 ? 0 : curve.code.size() / count;
  for (std::size_t i = 0; i < count; ++i) {
    const CurvePoint& here = curve.points[i];
    const CurvePoint& next = curve.points[std::min(i + 1, count - 1)];
    for (int k = 0; k < (i + 1 < count ? n : 1); ++k) {
      CurvePoint& p = fine.points.emplace_back(2 * k <= n ? here : next);
      p.position = between<Eigen::Vector2f>(static_cast<float>(n) * here.position,
                                            static_cast<float>(n) * next.position, k, n);
      p.normal = between<Eigen::Vector2f>(here.normal, next.normal, k, n).normalized();
      p.sigma_px *= static_cast<float>(n);
      p.width_px *= static_cast<float>(n);
      const auto code =
          curve.code.begin() + static_cast<std::ptrdiff_t>((2 * k <= n ? i : i + 1) * colors);
      fine.code.insert(fine.code.end(), code, code + static_cast<std::ptrdiff_t>(colors));
    }
  }
  return fine;
}

/// A stretch of a coarse curve on the fine one.
template <class Run>
void to_fine(int n, Run& run) {
  run.begin *= n;
  run.end = (run.end - 1) * n + 1;
}

/// Curves and labels of one camera.
void to_fine(int n, std::size_t camera, PointResult& result) {
  result.detections[camera].presence.clear();
  if (n == 1) return;
  const auto f = static_cast<float>(n);
  GridGraph& graph = result.graphs[camera];
  for (Curve& curve : graph.curves) curve = fine_curve(curve, n);
  for (Crossing& crossing : graph.crossings) {
    for (float* at : {&crossing.at_a, &crossing.at_b, &crossing.sigma_px}) *at *= f;
    crossing.position *= f;
  }
  graph.lit.cell_px = {f * graph.lit.cell_px.width, f * graph.lit.cell_px.height};
  Labeling& labeling = result.labeling;
  for (auto* runs : {&labeling.runs, &labeling.tentative}) {
    if (camera < runs->size())
      for (LabeledRun& run : (*runs)[camera]) to_fine(n, run);
  }
  if (camera < labeling.undecided.size())
    for (UndecidedRun& run : labeling.undecided[camera]) to_fine(n, run);
  if (camera < labeling.denied.size()) {
    for (DeniedRun& run : labeling.denied[camera]) {
      to_fine(n, run.predicted);
      run.spacing_px *= f;
    }
  }
  for (ComponentReport& component : labeling.components) {
    if (component.camera != static_cast<int>(camera)) continue;
    for (double* px : {&component.sigma_min, &component.sigma_second, &component.residual_rms_px})
      *px *= n;
  }
}

/// The crossings of one camera. What they miss each other by is in pixels of projectors.
void to_fine(int n, CrossingDisagreement& crossings) {
  if (crossings.shift_px) *crossings.shift_px *= n;
}

/// Two points that follow each other on one line of a picture.
bool are_beside(const MeasuredPoint& a, const MeasuredPoint& b) {
  constexpr float kFarthest = 2;  // coarse pixels
  return a.camera == b.camera && a.projector == b.projector && a.pattern == b.pattern &&
         a.line == b.line && std::hypot(a.u - b.u, a.v - b.v) < kFarthest;
}

/// Points in fine pixels, as far apart as the fine curves' are.
void refine_points(const CoarseView& view, PointResult& result, std::vector<char>& used) {
  const auto unit = static_cast<float>(view.unit);
  for (PointEvidence& e : result.evidence) {
    for (float* length : {&e.own, &e.surface, &e.difference}) *length *= unit;
  }
  std::vector<MeasuredPoint> points;
  std::vector<PointEvidence> evidence;
  std::vector<char> is_used;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const MeasuredPoint& here = result.points[i];
    const MeasuredPoint& next = result.points[std::min(i + 1, result.points.size() - 1)];
    const int n = view.binning[here.camera];
    const auto f = static_cast<float>(n);
    const bool goes_on = i + 1 < result.points.size() && are_beside(here, next);
    for (int k = 0; k < (goes_on ? n : 1); ++k) {
      const bool is_here = 2 * k <= n;
      MeasuredPoint& p = points.emplace_back(is_here ? here : next);
      p.u = between(f * here.u, f * next.u, k, n);
      p.v = between(f * here.v, f * next.v, k, n);
      p.x = unit * between(here.x, next.x, k, n);
      p.y = unit * between(here.y, next.y, k, n);
      p.z = unit * between(here.z, next.z, k, n);
      p.sigma *= unit;
      if (!result.evidence.empty()) evidence.push_back(result.evidence[is_here ? i : i + 1]);
      if (!used.empty()) is_used.push_back(used[is_here ? i : i + 1]);
    }
  }
  result.points = std::move(points);
  result.evidence = std::move(evidence);
  used = std::move(is_used);
}

}  // namespace

std::optional<CoarseView> coarse_view(const Rig& rig, const Frame& frame,
                                      const FrameOptions& options) {
  if (options.joined_pixels == 1) return std::nullopt;
  CoarseView view;
  view.unit = options.joined_pixels;
  view.rig = scaled(rig, 1 / view.unit);
  view.frame = frame;
  view.options = options;
  view.options.joined_pixels = 1;
  view.options.shape.depth.depth = of_joined(view.unit, options.shape.depth.depth);
  for (const Camera& camera : rig.cameras)
    view.binning.push_back(camera.sees_texture_only ? 1 : options.joined_pixels);
  view.overexposed_pixels.resize(rig.cameras.size());
  parallel_for(rig.cameras.size(), [&](std::size_t c) {
    const int n = view.binning[c];
    if (n == 1) return;
    if (!frame.images[c].empty())
      view.overexposed_pixels[c] =
          static_cast<std::size_t>(cv::countNonZero(overexposed(frame.images[c])));
    view.rig.cameras[c] = binned(view.rig.cameras[c], n);
    for (auto* images : {&view.frame.images, &view.frame.plain}) {
      if (c < images->size() && !(*images)[c].empty())
        (*images)[c] = binned_light(rig.cameras[c], (*images)[c], n);
    }
  });
  return view;
}

FrameResult in_fine_pixels(const CoarseView& view, FrameResult result) {
  for (std::size_t c = 0; c < view.binning.size(); ++c) {
    CameraDetection& detection = result.points.detections[c];
    detection.joined_pixels = view.binning[c];
    if (view.binning[c] > 1) detection.saturated_pixels = view.overexposed_pixels[c];
    to_fine(view.binning[c], c, result.points);
    if (c < result.points.device_crossings.size())
      to_fine(view.binning[c], result.points.device_crossings[c]);
  }
  refine_points(view, result.points, result.shape.surface.used);
  scale_lengths(view.unit, result.shape);
  for (DepthMap& map : result.shape.depth.maps) {
    const int binning = view.binning[static_cast<std::size_t>(map.camera)];
    map.stride *= binning;
    scale_pixels(1.F / static_cast<float>(binning), map);
  }
  for (CameraDepthReport& camera : result.shape.depth.report.cameras)
    camera.blur_px *= view.binning[static_cast<std::size_t>(camera.camera)];
  return result;
}

}  // namespace pencilscan
