#include "pencilscan/detection/refine.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "pencilscan/core/lanes.h"
#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/curve_rendering.h"
#include "pencilscan/detection/curve_smoothing.h"
#include "pencilscan/detection/fitted_points.h"
#include "pencilscan/detection/own_light.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/detection/refine_scales.h"
#include "pencilscan/detection/sample_fit.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

/// Samples the image across the curve, with the curve's own model added back where `residual` holds
/// the image without all curves.
std::vector<Profile> profiles_along(const cv::Mat& residual, const std::vector<CurvePoint>& points,
                                    bool add_own) {
  std::vector<Profile> profiles(points.size());
  Profile own;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const CurvePoint& p = points[i];
    sample_across(residual, p, profiles[i]);
    if (!add_own || p.amplitude <= 0) continue;
    line_profile(p.width_px, own);
    for (std::size_t k = 0; k < own.size(); ++k) profiles[i][k] += p.amplitude * own[k];
  }
  return profiles;
}

PENCILSCAN_CLONES
void mean_profile(const Profile* first, int count, Profile& mean) {
  Lanes left{};
  Lanes right{};
  for (int j = 0; j < count; ++j) {
    Lanes values;
    load(first[j].data(), values);
    left += values;
    load(first[j].data() + kLanes, values);
    right += values;
  }
  const float weight = 1 / static_cast<float>(count);
  store(weight * left, mean.data());
  store(weight * right, mean.data() + kLanes);
}

/// Fits of eight points at once, from `first` on.
void fit_batch(const std::vector<CurvePoint>& points, const std::vector<Profile>& profiles,
               const std::vector<int>& half_arcs, bool first_round, int first, ProfileFits& fits) {
  const int n = static_cast<int>(points.size());
  ProfileBatch batch;
  Profile mean;
  for (int k = 0; k < kLanes; ++k) {
    const int i = std::min(first + k, n - 1);
    const int r = half_arcs[static_cast<std::size_t>(i)];
    mean_profile(&profiles[static_cast<std::size_t>(i - r)], 2 * r + 1, mean);
    for (std::size_t o = 0; o < kProfileSize; ++o) batch.value[o][k] = mean[o];
    const float width = points[static_cast<std::size_t>(i)].width_px;
    // At first the neighbours are still in the image: a shorter profile sees less of them.
    int half = std::clamp(nearest(2.4F * width) + (first_round ? 0 : 1), 4, kMaxHalf);
    const auto at = [&](int o) { return batch.value[static_cast<std::size_t>(kMaxHalf + o)][k]; };
    if (first_round) {
      // Where a neighbour's light begins before its end, the profile ends in the valley between.
      const auto both = [&](int o) { return at(o) + at(-o); };
      int valley = half;
      for (int o = half; o >= 3; --o) valley = both(o) < both(valley) ? o : valley;
      // Of the line's own height: lines side by side are about as bright as each other, what noise
      // and crossing lines add is less.
      constexpr float kRise = 0.75F;
      if (both(half) - both(valley) > kRise * (both(0) - both(valley))) half = valley;
    }
    batch.half[k] = static_cast<float>(half);
    batch.amplitude[k] = at(0) - std::min(at(-half), at(half));
    batch.width[k] = width;
  }
  fit_profiles(batch, fits);
}

/// Profiles to either side of each point that its fit averages: as many before as after it, so that
/// it does not shift towards the inside of a curve, and no dark ones. 0 for these.
std::vector<int> half_arcs(const std::vector<char>& is_dark, int most) {
  std::vector<int> result(is_dark.size(), 0);
  for_each_stretch(is_dark, [&](int begin, int end) {
    for (int i = begin; i < end && is_dark[static_cast<std::size_t>(begin)] == 0; ++i)
      result[static_cast<std::size_t>(i)] = std::min({most, i - begin, end - 1 - i});
  });
  return result;
}

void fit_curve(const std::vector<Profile>& profiles, const std::vector<char>& is_dark,
               bool first_round, int half_arc, Curve& curve) {
  std::vector<CurvePoint>& points = curve.points;
  const int n = static_cast<int>(points.size());
  const std::vector<int> averaged = half_arcs(is_dark, half_arc);
  std::vector<ProfileFit> fits(points.size());
  for (int first = 0; first < n; first += kLanes) {
    ProfileFits batch;
    fit_batch(points, profiles, averaged, first_round, first, batch);
    for (int k = 0; k < std::min(kLanes, n - first); ++k) {
      const auto at = static_cast<std::size_t>(first + k);
      fits[at] = fit_of(batch, k);
      fits[at].good = fits[at].good && is_dark[at] == 0;
    }
  }
  take_fits(fits, points);
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i].good) continue;
    points[i].amplitude = 0;
    points[i].sigma_px = 1;
  }
}

float kept_share(const RefineOptions& options) {
  return static_cast<float>(options.end_amplitude_ratio);
}

/// Of dense lines the fit gives the least width: as thin as the picture can show them.
bool sound(const CurvePoint& p, const RefineOptions& options) {
  return p.amplitude > 0 && p.sigma_px < options.max_sigma_px && p.width_px < kMaxLineWidth;
}

/// True when going from b to c leaves the direction from a to b by a jump.
bool jumps(const CurvePoint& a, const CurvePoint& b) {
  const Vector2f way = b.position - a.position;
  const float along = std::abs(way.dot(a.tangent()));
  const float lateral = std::abs(way.dot(a.normal));
  return way.norm() > 3 || lateral > 0.5F + 0.3F * along;
}

/// The points without faint ends.
std::span<const CurvePoint> trimmed(std::span<const CurvePoint> points, float ratio) {
  constexpr std::size_t kInward = 5;
  const auto faint = [&](const CurvePoint& end, const CurvePoint& inner) {
    return end.amplitude < ratio * inner.amplitude;
  };
  std::size_t first = 0;
  std::size_t last = points.size();
  while (first + kInward < last && faint(points[first], points[first + kInward])) ++first;
  while (last > first + kInward && faint(points[last - 1], points[last - 1 - kInward])) --last;
  return points.subspan(first, last - first);
}

void cut_and_trim(const Curve& curve, const RefineOptions& options, std::vector<Curve>& result) {
  const std::span<const CurvePoint> points(curve.points);
  std::size_t begin = 0;
  const auto finish = [&](std::size_t end) {
    const auto piece = trimmed(points.subspan(begin, end - begin), kept_share(options));
    if (static_cast<int>(piece.size()) >= options.min_points)
      result.push_back({curve.family, {piece.begin(), piece.end()}, {}});
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!sound(points[i], options)) {
      finish(i);
      begin = i + 1;
    } else if (i > begin && jumps(points[i - 1], points[i])) {
      finish(i);
      begin = i;
    }
  }
  finish(points.size());
}

/// The image at one size, less the curves where they are subtracted, and the curves that are fitted
/// to it, in its pixels.
struct SizedImage {
  cv::Mat image;
  cv::Mat all_light;  ///< the image with the curves
  std::vector<Curve> curves;
};

class ImageSizes {
 public:
  explicit ImageSizes(const cv::Mat& full) : sizes_{{full, full, {}}} {}

  [[nodiscard]] SizedImage& at(std::size_t size) {
    while (sizes_.size() <= size) {
      const cv::Mat half = resized_image(sizes_.back().image, 1);
      sizes_.push_back({half, half, {}});
    }
    return sizes_[size];
  }
  [[nodiscard]] std::vector<SizedImage>& all() { return sizes_; }

  [[nodiscard]] std::vector<Curve> curves_at_full_size() const {
    std::vector<Curve> result = sizes_[0].curves;
    for (std::size_t size = 1; size < sizes_.size(); ++size) {
      for (const Curve& curve : sizes_[size].curves) result.push_back(resized(curve, size, 0));
    }
    return result;
  }

  void subtract_all_curves(const cv::Mat& full) {
    sizes_[0].image = full.clone();
    for (const Curve& curve : curves_at_full_size()) subtract_curve(curve, sizes_[0].image);
    for (std::size_t size = 1; size < sizes_.size(); ++size)
      sizes_[size].image = resized_image(sizes_[size - 1].image, 1);
  }

 private:
  std::vector<SizedImage> sizes_;
};

/// Fits a curve to the image, at the size that its width asks for.
void fit_first(ImageSizes& sizes, const RefineOptions& options, Curve curve) {
  constexpr int kMostTries = 3;  // the width that asks for a size is known better after each
  const auto size_for = [&](const Curve& c, std::size_t given_at) {
    return std::min(size_of_curve(c, given_at), static_cast<std::size_t>(options.sizes - 1));
  };
  std::size_t size = size_for(curve, 0);
  curve = resized(std::move(curve), 0, size);
  for (int t = 1;; ++t) {
    smooth_positions(curve.points);
    if (options.sizes > 1) {
      // Of a curve that several sizes show, the size of most of it holds all.
      for (CurvePoint& p : curve.points) p.width_px = std::min(p.width_px, kWidestProfilePx);
    }
    Curve fitted = curve;
    // The light of others is still there: which point is dark shows later.
    fit_curve(profiles_along(sizes.at(size).image, curve.points, false),
              std::vector<char>(curve.points.size(), 0), true, options.half_arc, fitted);
    smooth_widths(fitted.points);
    const std::size_t wanted = size_for(fitted, size);
    if (wanted == size || t == kMostTries) {
      cut_and_trim(fitted, options, sizes.at(size).curves);
      return;
    }
    for (std::size_t i = 0; i < curve.points.size(); ++i)
      curve.points[i].width_px = fitted.points[i].width_px;
    curve = resized(std::move(curve), size, wanted);
    size = wanted;
  }
}

/// Fits the curves of one size to its image without all others; where `samples` is not empty, to
/// the pixels that are none of 0 in it.
void fit_again(SizedImage& size, const cv::Mat& samples, const RefineOptions& options) {
  std::vector<Curve> sound_curves;
  for (Curve& curve : size.curves) {
    const Curve before = curve;
    if (samples.empty()) {
      const std::vector<Profile> profiles = profiles_along(size.image, curve.points, true);
      fit_curve(profiles,
                dark_points(curve.points, profiles, size.all_light, {}, kept_share(options)), false,
                options.half_arc, curve);
    } else {
      fit_to_samples(size.image, samples, options.half_arc, curve);
    }
    smooth_widths(curve.points);
    // The curves beside it meet the new fit at once, which saves a round.
    add_curve(before, size.image);
    subtract_curve(curve, size.image);
    cut_and_trim(curve, options, sound_curves);
  }
  size.curves = std::move(sound_curves);
}

/// Fits all curves again, to what the others leave of the image; `samples` are those of full size.
void fit_all_again(ImageSizes& sizes, const cv::Mat& presence, const cv::Mat& samples,
                   const RefineOptions& options) {
  for (SizedImage& size : sizes.all()) {
    for (Curve& curve : size.curves) smooth_positions(curve.points);
  }
  sizes.subtract_all_curves(presence);
  for (std::size_t size = 0; size < sizes.all().size(); ++size)
    fit_again(sizes.all()[size], size == 0 ? samples : cv::Mat(), options);
}

/// The part of the full image that the profiles of a curve need at `size`, whole pixels of that.
cv::Rect profiles_of(const Curve& curve, std::size_t size, cv::Size image) {
  constexpr float kBlur = 2;  // of pyrDown()
  Eigen::AlignedBox2f box;
  for (const CurvePoint& p : curve.points) box.extend(p.position);
  const float unit = static_cast<float>(1U << size);
  const float margin = unit * (kMaxHalf + kBlur);
  const auto low = [&](float x) {
    return static_cast<int>(std::floor((x - margin) / unit) * unit);
  };
  const auto high = [&](float x) { return static_cast<int>(std::ceil(x + margin)) + 1; };
  const cv::Point from(std::max(0, low(box.min().x())), std::max(0, low(box.min().y())));
  const cv::Point to(std::min(image.width, high(box.max().x())),
                     std::min(image.height, high(box.max().y())));
  return {from, to};
}

}  // namespace

float sample_bilinear(const cv::Mat& image, float x, float y) {
  x = std::clamp(x, 0.F, static_cast<float>(image.cols - 1));
  y = std::clamp(y, 0.F, static_cast<float>(image.rows - 1));
  const int ix = std::min(static_cast<int>(x), image.cols - 2);
  const int iy = std::min(static_cast<int>(y), image.rows - 2);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const float* a = image.ptr<float>(iy) + ix;
  const float* b = image.ptr<float>(iy + 1) + ix;
  return (1 - fy) * ((1 - fx) * a[0] + fx * a[1]) + fy * ((1 - fx) * b[0] + fx * b[1]);
}

std::vector<Curve> refine_curves(const cv::Mat& presence, std::vector<Curve> curves,
                                 const RefineOptions& options) {
  ImageSizes sizes(presence);
  for (Curve& curve : curves) fit_first(sizes, options, std::move(curve));
  for (int round = 1; round < options.rounds; ++round) fit_all_again(sizes, presence, {}, options);
  return sizes.curves_at_full_size();
}

std::vector<Curve> refit_to_samples(const cv::Mat& presence, const cv::Mat& samples,
                                    std::vector<Curve> curves, RefineOptions options) {
  options.end_amplitude_ratio = 0;  // ends were trimmed
  for (int round = 0; round < options.rounds; ++round) {
    ImageSizes sizes(presence);
    for (Curve& curve : curves) {
      const std::size_t size =
          std::min(size_of_curve(curve, 0), static_cast<std::size_t>(options.sizes - 1));
      sizes.at(size).curves.push_back(resized(std::move(curve), 0, size));
    }
    fit_all_again(sizes, presence, samples, options);
    curves = sizes.curves_at_full_size();
  }
  return curves;
}

std::vector<Curve> fit_guess(const cv::Mat& unexplained, Curve guess,
                             const RefineOptions& options) {
  // No fit at full size gives a line that is wider.
  const std::size_t size = median_width(guess.points) > kMaxLineWidth ? size_of_curve(guess, 0) : 0;
  cv::Mat image = unexplained;
  Vector2f corner(0, 0);
  if (size > 0) {
    const cv::Rect around = profiles_of(guess, size, unexplained.size());
    image = resized_image(unexplained(around), size);
    corner = {static_cast<float>(around.x), static_cast<float>(around.y)};
    for (CurvePoint& p : guess.points) p.position -= corner;
    guess = resized(std::move(guess), 0, size);
  }
  // Once only: between lines this dense, a second fit to the others' residual moves away.
  const std::vector<Profile> profiles = profiles_along(image, guess.points, false);
  std::vector<float> expected;
  for (const CurvePoint& p : guess.points) expected.push_back(p.amplitude);
  fit_curve(profiles, dark_points(guess.points, profiles, {}, expected, kept_share(options)), true,
            options.half_arc, guess);
  smooth_widths(guess.points);
  std::vector<Curve> pieces;
  cut_and_trim(guess, options, pieces);
  if (size == 0) return pieces;
  for (Curve& piece : pieces) {
    piece = resized(std::move(piece), size, 0);
    for (CurvePoint& p : piece.points) p.position += corner;
  }
  return pieces;
}

}  // namespace pencilscan
