#include "pencilscan/simulation/panel_light.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

double normal_cdf(double t) { return 0.5 * std::erfc(-t * M_SQRT1_2); }

Vec3 to_vec(const Rgb& rgb) { return {rgb[0], rgb[1], rgb[2]}; }

/// Lines as drawn on a continuous film: edges anywhere.
PanelProfile film_profile(const LinePattern& pattern, int size) {
  const double low = -0.5;
  const double high = size - 0.5;
  std::vector<double> knots{low};
  std::vector<Vec3> values;
  for (int line = 0; line < pattern.line_count(size); ++line) {
    const double center = pattern.position_px(line);
    const double begin = std::clamp(center - 0.5 * pattern.line_width_px, knots.back(), high);
    const double end = std::clamp(center + 0.5 * pattern.line_width_px, begin, high);
    if (begin > knots.back()) {
      values.push_back(Vec3::Zero());
      knots.push_back(begin);
    }
    if (end > begin) {
      values.push_back(to_vec(pattern.color(line)));
      knots.push_back(end);
    }
  }
  if (high > knots.back()) {
    values.push_back(Vec3::Zero());
    knots.push_back(high);
  }
  return {pattern.axis, std::move(knots), std::move(values)};
}

/// One value per panel pixel.
template <typename ValueOfIndex>
PanelProfile pixel_profile(Axis axis, int size, const ValueOfIndex& value) {
  std::vector<double> knots{-0.5};
  std::vector<Vec3> values;
  for (int i = 0; i < size; ++i) {
    knots.push_back(i + 0.5);
    values.push_back(value(i));
  }
  return {axis, std::move(knots), std::move(values)};
}

PanelLight finish(std::vector<PanelProfile> profiles, const FilmOptions& film) {
  if (film.blur_px > 0) {
    for (PanelProfile& profile : profiles) profile = profile.blurred(film.blur_px);
  }
  return {std::move(profiles), film.black_level};
}

}  // namespace

PanelProfile::PanelProfile(Axis axis, std::vector<double> knots, std::vector<Vec3> values)
    : axis_(axis), knots_(std::move(knots)), values_(std::move(values)) {
  PENCILSCAN_CHECK(knots_.size() == values_.size() + 1 && !values_.empty());
  integral_.assign(knots_.size(), Vec3::Zero());
  for (std::size_t i = 0; i < values_.size(); ++i) {
    integral_[i + 1] = integral_[i] + (knots_[i + 1] - knots_[i]) * values_[i];
  }
}

Vec3 PanelProfile::integral(double px) const {
  if (px <= knots_.front()) return Vec3::Zero();
  if (px >= knots_.back()) return integral_.back();
  const auto next = std::upper_bound(knots_.begin(), knots_.end(), px);
  const auto i = static_cast<std::size_t>(next - knots_.begin()) - 1;
  return integral_[i] + (px - knots_[i]) * values_[i];
}

Vec3 PanelProfile::mean(double px, double box_px) const {
  // Below this width the difference of integrals loses digits and no image could tell.
  const double box = std::max(box_px, 1e-6);
  return (integral(px + 0.5 * box) - integral(px - 0.5 * box)) / box;
}

PanelProfile PanelProfile::blurred(double sigma_px) const {
  PENCILSCAN_CHECK(sigma_px > 0);
  // The profile is a sum of steps, so its blur is a sum of normal distribution functions; sampled
  // finely enough to be piecewise constant again (symmetric cells: line centres stay).
  constexpr double kReach = 5;  // sigmas; beyond it a step counts as whole (error 3e-7)
  const double low = knots_.front();
  const double high = knots_.back();
  const auto cells =
      static_cast<std::size_t>(std::ceil((high - low) / std::clamp(sigma_px / 4, 0.01, 0.0625)));
  const double cell = (high - low) / static_cast<double>(cells);
  std::vector<double> knots{low};
  std::vector<Vec3> values;
  std::size_t first = 0;  // first knot within reach
  Vec3 before = Vec3::Zero();
  const auto jump = [&](std::size_t k) -> Vec3 {
    return (k < values_.size() ? values_[k] : Vec3::Zero()) -
           (k > 0 ? values_[k - 1] : Vec3::Zero());
  };
  for (std::size_t i = 0; i < cells; ++i) {
    const double x = low + (static_cast<double>(i) + 0.5) * cell;
    while (first < knots_.size() && knots_[first] < x - kReach * sigma_px) before += jump(first++);
    Vec3 value = before;
    for (std::size_t k = first; k < knots_.size() && knots_[k] < x + kReach * sigma_px; ++k) {
      value += normal_cdf((x - knots_[k]) / sigma_px) * jump(k);
    }
    values.push_back(value);
    knots.push_back(low + static_cast<double>(i + 1) * cell);
  }
  return {axis_, std::move(knots), std::move(values)};
}

Vec3 PanelLight::at(const Vec2& pixel, const Vec2& box_px) const {
  Vec3 sum = Vec3::Zero();
  for (const PanelProfile& profile : profiles) {
    const auto i = static_cast<Eigen::Index>(profile.axis());
    sum += profile.mean(pixel[i], box_px[i]);
  }
  if (profiles.size() > 1) sum = sum.cwiseMin(1.0);
  if (black_level > 0) sum = Vec3::Constant(black_level) + (1 - black_level) * sum;
  return sum;
}

PanelLight line_light(const Projector& projector, const FilmOptions& film) {
  std::vector<PanelProfile> profiles;
  for (const LinePattern& pattern : projector.patterns) {
    const int size = projector.size_across(pattern);
    profiles.push_back(film.pixelated
                           ? pixel_profile(pattern.axis, size,
                                           [&](int i) { return to_vec(pattern.value(i, size, 1)); })
                           : film_profile(pattern, size));
  }
  return finish(std::move(profiles), film);
}

std::vector<PanelLight> line_lights(const Rig& rig, const FilmOptions& film) {
  std::vector<PanelLight> lights;
  for (const Projector& projector : rig.projectors) lights.push_back(line_light(projector, film));
  return lights;
}

PanelLight gray_code_light(const Projector& projector, const GrayCodeImage& image,
                           const FilmOptions& film) {
  const int size = image.axis == Axis::kColumn ? projector.width : projector.height;
  return finish({pixel_profile(image.axis, size,
                               [&](int i) { return Vec3::Constant(image.bright(i) ? 1.0 : 0.0); })},
                film);
}

PanelLight solid_light(const Projector& projector, const SolidImage& image,
                       const FilmOptions& film) {
  return finish(
      {pixel_profile(Axis::kColumn, projector.width, [&](int) { return to_vec(image.value); })},
      film);
}

}  // namespace pencilscan
