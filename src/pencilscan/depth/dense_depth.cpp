#include "pencilscan/depth/dense_depth.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "pencilscan/depth/background_view.h"
#include "pencilscan/depth/seeds.h"
#include "pencilscan/depth/shared_bends.h"

namespace pencilscan {
namespace {

/// Cosine of the incidence to the camera.
double incidence(const CameraLight& light, const Vec2& pixel, const Quadric& q, int half) {
  const Camera& camera = *light.camera;
  const Vec2 m = camera.normalized_from_pixel(pixel);
  const Vec2 slope = camera.pixel_slope(m).transpose() * Vec2(q[1] / half, q[2] / half);
  const Vec3 normal = -Vec3(slope[0], slope[1], q[0] - slope.dot(m)).normalized();
  return -normal.dot(m.homogeneous().normalized());
}

/// What a fit leaves of the light. Windows behind a mosaic are as wide as their noise makes best
/// (options_for()): what noise explains, 1 / misfit of the variance, is no misfit there.
double relative_residual(const CameraLight& light, const WindowFit& fit) {
  const auto residual = static_cast<double>(fit.relative_residual);
  if (!light.of_mosaic) return residual;
  return residual * std::sqrt(std::max(0.0, 1 - 1 / static_cast<double>(fit.misfit)));
}

bool acceptable(const CameraLight& light, const Vec2& pixel, const WindowFit& fit,
                const ObjectSpace& space, int half, const DepthOptions& options) {
  if (fit.misfit > options.max_misfit) return false;
  const auto usual = static_cast<double>(light.usual_residual);
  if (relative_residual(light, fit) > std::max(options.max_relative_residual, 2 * usual))
    return false;
  if (std::sqrt(fit.variance) * static_cast<double>(fit.lines_per_w) > options.max_sigma_lines)
    return false;
  if (incidence(light, pixel, fit.q, half) < options.min_cosine) return false;
  const Vec3 x = light.camera->point_at_depth(pixel, 1 / fit.q[0]);
  return space.holds(x);
}

DepthNode node_of(const WindowFit& fit, int half, LitSets& lit_sets) {
  DepthNode node;
  set_quadric(fit.q, half, node);
  node.cut = fit.cut;
  node.sigma = static_cast<float>(std::sqrt(fit.variance) / (fit.q[0] * fit.q[0]));
  node.misfit = fit.misfit;
  node.lit = lit_sets.place_of(fit.lit);
  node.reason = HoleReason::kMeasured;
  return node;
}

/// Nodes without depth whose windows are overexposed for the most part.
void mark_saturated(const CameraLight& light, int half, DepthMap& map) {
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    if (map.nodes[i].measured()) continue;
    const int u = static_cast<int>(map.pixel(i)[0]);
    const int v = static_cast<int>(map.pixel(i)[1]);
    if (light.valid.at<std::uint8_t>(v, u) != 0) continue;
    const cv::Rect window = cv::Rect(u - half, v - half, 2 * half + 1, 2 * half + 1) &
                            cv::Rect(0, 0, light.valid.cols, light.valid.rows);
    if (2 * cv::countNonZero(light.valid(window)) < window.area())
      map.nodes[i].reason = HoleReason::kSaturated;
  }
}

constexpr std::size_t kPilots = 100;
constexpr double kFacing = 0.5;  // cosine; flatter, a plane from other cameras is off in its slope

double cost(const WindowFit& fit) { return static_cast<double>(fit.misfit); }

}  // namespace

/// A mosaic leaves a quarter of the samples, also where the camera fills its colours in, so noise
/// at a window's centre doubles. It falls as 1 / r with the radius r, what a quadric leaves of the
/// surface grows as r^4: the best r goes as the fifth root of the noise. That is so on the whole:
/// at a rim or a crease windows may fit that are not widened.
DepthOptions options_for(const CameraLight& light, DepthOptions options) {
  constexpr double kWider = 1.1487;  // 2^(1/5)
  constexpr int kWidestHalf = 10;    // of what a window may be (dense_depth.h)
  constexpr int kLargestStride = 8;
  const int plain = options.half;
  if (light.of_mosaic)
    options.half = static_cast<int>(std::lround((options.half + 0.5) * kWider - 0.5));
  // A window holds a line with half as much of the dark on both its sides. One that holds an edge
  // alone takes any error of the line's width for depth (docs/depth.md).
  const int of_line = std::min(static_cast<int>(std::lround(light.line_px)), kWidestHalf);
  if (of_line > options.half) {
    options.half = of_line;
    // As dense in windows as before; wider windows beside these need an even number.
    const int even = options.stride * (2 * of_line + 1) / (2 * plain + 1) / 2 * 2;
    options.stride = std::clamp(even, options.stride, kLargestStride);
  }
  options.narrow_half = std::clamp(of_line, plain, options.half);
  return options;
}

std::vector<PilotWindow> pilot_windows(const CameraLight& light, int camera,
                                       std::span<const MeasuredPoint> points,
                                       const DepthOptions& options) {
  const CurveSeeds seeds(*light.camera, camera, points);
  std::vector<PilotWindow> pilots;
  std::size_t own = 0;
  for (const MeasuredPoint& p : points) own += p.camera == camera ? 1 : 0;
  const std::size_t step = std::max<std::size_t>(1, own / kPilots);
  std::size_t i = 0;
  for (const MeasuredPoint& p : points) {
    if (p.camera != camera) continue;
    if (i++ % step != 0) continue;
    const Vec2 pixel(std::round(p.u), std::round(p.v));
    const auto planes = seeds.planes(pixel, options.seed_radius_px, options.half);
    if (!planes.empty()) pilots.push_back({pixel, planes[0]});
  }
  return pilots;
}

std::vector<PilotWindow> pilot_windows(const CameraLight& light, const RayScene& surface,
                                       const DepthMap& map, const DepthOptions& options) {
  const TriangleMesh& mesh = surface.mesh();
  std::vector<PilotWindow> all;
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    const Vec2 pixel = map.pixel(i);
    const Ray ray = light.camera->ray(pixel);
    const auto hit = surface.first_hit(ray);
    if (!hit || !is_measured(mesh, hit->face)) continue;
    const Vec3 normal = face_normal(mesh, hit->face);
    if (-ray.direction.dot(normal) < kFacing) continue;
    all.push_back(
        {pixel, quadric_of(TangentView(*light.camera, hit->point, normal), options.half)});
  }
  const std::size_t step = std::max<std::size_t>(1, all.size() / kPilots);
  std::vector<PilotWindow> pilots;
  for (std::size_t i = 0; i < all.size(); i += step) pilots.push_back(all[i]);
  return pilots;
}

namespace {

/// Windows of full radius, then those that are narrower.
std::vector<DepthOptions> by_radius(const DepthOptions& options) {
  std::vector<DepthOptions> passes{options};
  if (options.narrow_half < options.half) {
    passes.push_back(options);
    passes.back().half = options.narrow_half;
  }
  return passes;
}

/// Fits the windows of nodes without depth, each from all of starts_of(pixel), and keeps the best
/// fit. keep(pixel, fit, node) may refuse it, and marks the new node.
template <class Starts, class Keep>
void fit_nodes(const CameraLight& light, const Background& background, const DepthOptions& options,
               DepthMap& map, FittedWindows& fitted, Starts starts_of, Keep keep) {
  WindowFitter fitter(light, options.half);
  const BackgroundView behind(light, background, options.seed_radius_px);
  for (std::size_t i = 0; i < map.nodes.size(); ++i) {
    if (map.nodes[i].measured()) continue;
    const Vec2 pixel = map.pixel(i);
    std::optional<WindowFit> best;
    for (const Quadric& start : starts_of(pixel)) {
      const auto fit = fitter.fit(pixel, start, 5);
      if (fit && acceptable(light, pixel, *fit, background.space, options.half, options) &&
          (!best || cost(*fit) < cost(*best))) {
        best = fit;
      }
    }
    if (!best) continue;
    DepthNode node = node_of(*best, options.half, map.lit_sets);
    if (!keep(pixel, *best, node) || behind.shows(pixel, *best, fitter)) continue;
    map.nodes[i] = node;
    fitted.add(i, best->information);
  }
}

/// Nodes near labelled curves.
void fit_at_curves(const CameraLight& light, const CurveSeeds& seeds, const Background& background,
                   const DepthOptions& options, DepthMap& map, FittedWindows& fitted) {
  const auto starts_of = [&](const Vec2& pixel) {
    return seeds.planes(pixel, options.seed_radius_px, options.half);
  };
  const auto keep = [](const Vec2&, const WindowFit&, DepthNode& node) {
    node.seeded = true;
    return true;
  };
  fit_nodes(light, background, options, map, fitted, starts_of, keep);
}

/// Nodes whose rays meet the closed surface; what ends far from it is off by a line.
void fit_at_surface(const CameraLight& light, const RayScene& surface, const Background& background,
                    const DepthOptions& options, DepthMap& map, FittedWindows& fitted) {
  constexpr float kConfidence = 0.9F;  // of rendered objects' nodes, 96 % or more are right
  const Camera& camera = *light.camera;
  std::optional<RayScene::Hit> hit;  // of the pixel whose starts were asked for last
  const auto starts_of = [&](const Vec2& pixel) -> std::vector<Quadric> {
    hit = surface.first_hit(camera.ray(pixel));
    if (!hit) return {};
    const Vec3 normal = face_normal(surface.mesh(), hit->face);
    return {quadric_of(TangentView(camera, hit->point, normal), options.half)};
  };
  const auto keep = [&](const Vec2& pixel, const WindowFit& fit, DepthNode& node) {
    node.confidence = kConfidence;
    return (camera.point_at_depth(pixel, 1 / fit.q[0]) - hit->point).norm() <= options.max_move;
  };
  fit_nodes(light, background, options, map, fitted, starts_of, keep);
}

void grow(const CameraLight& light, const Background& background, const DepthOptions& options,
          DepthMap& map, FittedWindows& fitted) {
  WindowFitter fitter(light, options.half);
  const BackgroundView behind(light, background, options.seed_radius_px);
  const ObjectSpace& space = background.space;
  std::vector<std::size_t> front;
  for (std::size_t i = 0; i < map.nodes.size(); ++i)
    if (map.nodes[i].measured()) front.push_back(i);
  constexpr int kRounds = 8;
  std::vector<char> tried(map.nodes.size(), 0);
  for (int round = 0; round < kRounds && !front.empty(); ++round) {
    std::vector<std::pair<std::size_t, std::size_t>> next;  // node, from
    for (const std::size_t i : front) {
      const int row = static_cast<int>(i) / map.columns;
      const int column = static_cast<int>(i) % map.columns;
      for (const auto& [dr, dc] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
        const int r = row + dr, c = column + dc;
        if (r < 0 || c < 0 || r >= map.rows || c >= map.columns) continue;
        const std::size_t j = map.index(r, c);
        if (map.nodes[j].measured()) continue;
        next.emplace_back(j, i);
      }
    }
    std::sort(next.begin(), next.end());
    front.clear();
    std::vector<std::pair<std::size_t, WindowFit>> found;
    for (std::size_t k = 0; k < next.size();) {
      const std::size_t j = next[k].first;
      std::optional<WindowFit> best;
      for (; k < next.size() && next[k].first == j; ++k) {
        const Vec2 way = map.pixel(j) - map.pixel(next[k].second);
        const Quadric start = quadric_at(map.nodes[next[k].second], way, options.half);
        const auto fit = fitter.fit(map.pixel(j), start, 5);
        if (fit && acceptable(light, map.pixel(j), *fit, space, options.half, options) &&
            (!best || cost(*fit) < cost(*best))) {
          best = fit;
        }
      }
      if (best && !behind.shows(map.pixel(j), *best, fitter)) found.emplace_back(j, *best);
    }
    for (const auto& [j, fit] : found) {
      map.nodes[j] = node_of(fit, options.half, map.lit_sets);
      fitted.add(j, fit.information);
      front.push_back(j);
    }
  }
}

}  // namespace

void grow(const CameraLight& light, const Background& background, const DepthOptions& options,
          DepthMap& map) {
  FittedWindows fitted{options.half, {}, {}};
  grow(light, background, options, map, fitted);
  share_bends(fitted, map);
}

DepthMap dense_depth(const CameraLight& light, int camera, std::span<const MeasuredPoint> points,
                     const Background& background, const DepthOptions& options) {
  DepthMap map;
  map.camera = camera;
  map.stride = options.stride;
  map.columns = (light.camera->width - 1) / options.stride + 1;
  map.rows = (light.camera->height - 1) / options.stride + 1;
  map.nodes.resize(static_cast<std::size_t>(map.columns) * static_cast<std::size_t>(map.rows));
  const CurveSeeds seeds(*light.camera, camera, points);
  std::vector<FittedWindows> passes;
  for (const DepthOptions& pass : by_radius(options)) {
    FittedWindows& fitted = passes.emplace_back(FittedWindows{pass.half, {}, {}});
    fit_at_curves(light, seeds, background, pass, map, fitted);
    grow(light, background, pass, map, fitted);
  }
  for (const FittedWindows& fitted : passes) share_bends(fitted, map);
  mark_saturated(light, options.half, map);
  return map;
}

std::size_t complete_map(const CameraLight& light, const RayScene& surface,
                         const Background& background, double sigma_factor,
                         const DepthOptions& options, DepthMap& map) {
  constexpr double kHardPlaces = 1.8;  // rims and gaps: errors beyond what the window's fit says
  std::vector<FittedWindows> passes;
  for (const DepthOptions& pass : by_radius(options)) {
    FittedWindows& fitted = passes.emplace_back(FittedWindows{pass.half, {}, {}});
    fit_at_surface(light, surface, background, pass, map, fitted);
  }
  std::size_t count = 0;
  for (const FittedWindows& fitted : passes) {
    share_bends(fitted, map);
    for (const std::size_t i : fitted.nodes)
      map.nodes[i].sigma *= static_cast<float>(kHardPlaces * sigma_factor);
    count += fitted.nodes.size();
  }
  return count;
}

}  // namespace pencilscan
