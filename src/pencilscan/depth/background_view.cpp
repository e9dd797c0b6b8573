#include "pencilscan/depth/background_view.h"

#include <Eigen/LU>
#include <cmath>

namespace pencilscan {
namespace {

constexpr double kSameLine = 0.2;  // lines; a floor off the stated plane, and its relief

/// The background's points at the light's pixels.
std::vector<MeasuredPoint> seen_by(const CameraLight& light, std::vector<MeasuredPoint> points) {
  for (MeasuredPoint& p : points) {
    const auto pixel = light.camera->project(position_of(p));
    if (!pixel) continue;
    p.u = static_cast<float>(pixel->x());
    p.v = static_cast<float>(pixel->y());
  }
  return points;
}

/// True when a fit that starts on the background stays there, and is as good.
bool is_as_good(const Vec2& pixel, const Quadric& start, const WindowFit& fit,
                WindowFitter& fitter) {
  constexpr float kAsWell = 1.1F;  // chi^2 of a window's hundred samples scatters by so much
  const auto behind = fitter.fit(pixel, start, 5);
  if (!behind || behind->misfit > kAsWell * fit.misfit || behind->lit.count() < fit.lit.count())
    return false;
  // It still is the background, over the whole window.
  return (behind->q - start).head<3>().cwiseAbs().sum() * static_cast<double>(behind->lines_per_w) <
         kSameLine;
}

}  // namespace

Quadric quadric_of(const TangentView& at, int half) {
  Quadric q = Quadric::Zero();
  q[0] = at.w;
  q.segment<2>(1) = half * at.slope.cast<double>();
  return q;
}

BackgroundView::BackgroundView(const CameraLight& light, const Background& background,
                               double seed_radius_px)
    : light_(light),
      seed_radius_px_(seed_radius_px),
      floor_(background.space.floor()),
      space_(background.space.with_floor()) {
  if (!background.points.empty())
    seeds_.emplace(*light.camera, background.points.front().camera,
                   seen_by(light, background.points));
}

bool BackgroundView::shows(const Vec2& pixel, const WindowFit& fit, WindowFitter& fitter) const {
  return shows_floor(pixel, fit, fitter) || shows_named_lines(pixel, fit, fitter);
}

bool BackgroundView::shows_named_lines(const Vec2& pixel, const WindowFit& fit,
                                       WindowFitter& fitter) const {
  if (!seeds_) return false;
  for (const Quadric& start : seeds_->planes(pixel, seed_radius_px_, fitter.half()))
    if (is_as_good(pixel, start, fit, fitter)) return true;
  return false;
}

bool BackgroundView::shows_floor(const Vec2& pixel, const WindowFit& fit,
                                 WindowFitter& fitter) const {
  if (!floor_) return false;
  const Ray ray = light_.camera->ray(pixel);
  const double descent = -ray.direction.dot(floor_->normal);
  const double height = floor_->height(ray.origin);
  if (!(descent > 0) || !(height > 0)) return false;
  const Vec3 point = ray.origin + height / descent * ray.direction;
  if (!space_.holds(point)) return false;
  const TangentView at(*light_.camera, point, floor_->normal);
  const Vec2 m = light_.camera->normalized_from_pixel(pixel);
  const Eigen::Matrix2d jacobian = light_.camera->pixel_slope(m).inverse();
  for (std::size_t k = 0; k < light_.patterns.size(); ++k) {
    if (!fit.lit.test(k)) continue;
    const auto fitted = line(k, m, jacobian, fit.q[0]);
    const auto on_floor = line(k, m, jacobian, at.w);
    if (!fitted || !on_floor) return false;
    const double apart = *fitted - *on_floor;
    if (std::abs(apart - std::round(apart)) > kSameLine) return false;
  }
  return is_as_good(pixel, quadric_of(at, fitter.half()), fit, fitter);
}

std::optional<double> BackgroundView::line(std::size_t pattern, const Vec2& m,
                                           const Eigen::Matrix2d& jacobian, double w) const {
  bool ok = false;
  const WindowLines lines = light_.patterns[pattern].lines(m, jacobian, w, ok);
  if (!ok) return std::nullopt;
  return static_cast<double>(lines.line(0, 0, static_cast<float>(w)));
}

}  // namespace pencilscan
