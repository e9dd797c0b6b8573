#include "pencilscan/detection/refine.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr int kMaxHalf = 7;  ///< largest half-length of a profile, px
constexpr float kMinWidth = 0.6F;
constexpr float kMaxWidth = 4.5F;
constexpr float kModelReach = 3.0F;  ///< profiles are rendered to this many widths
constexpr float kWidthPrior = 0.2F;  ///< weight of the width's prior, in profile samples
constexpr float kTiltPrior = 1.0F;   ///< weight of the prior of even light along the profile

/// Values across a curve at -kMaxHalf..kMaxHalf px; one more, never used, fills the last register.
using Profile = Eigen::Array<float, 2 * kMaxHalf + 2, 1>;

/// What a camera sees across a projected line: a box with blurred edges, the difference of two
/// logistic steps at +-half of scale `edge`, with second moment width^2 = (half^2 + (pi edge)^2)
/// / 3. Its edges place the line where light that varies along the profile would pull a Gaussian
/// aside, and subtracting it leaves less behind, where weaker lines lie.
struct LineProfile {
  float rate = 2;   ///< 1 / edge
  float tail = 0;   ///< exp(-half / edge)
  float scale = 1;  ///< makes the height 1

  explicit LineProfile(float width) {
    constexpr float kEdge = 0.5F;      // px: pixel, lens and projector blur together
    constexpr float kBluntest = 0.5F;  // of the width: beyond, no box is left
    const float edge = std::min(kEdge, kBluntest * width);
    constexpr float kPi2 = 9.8696F;
    const float half = std::sqrt(3 * width * width - kPi2 * edge * edge);
    rate = 1 / edge;
    tail = std::exp(-rate * half);
    scale = (1 + tail) / (1 - tail);
  }
  template <class Value>
  [[nodiscard]] Value at(const Value& d) const {
    using std::exp;
    // Steps at -half and half, written so that no exponential overflows within reach.
    const Value e = exp(-rate * d);
    return scale * (1 / (1 + tail * e) - tail / (tail + e));
  }
};

Profile profile_offsets() { return Profile::LinSpaced(-kMaxHalf, kMaxHalf + 1); }

/// Places points on a local parabola through their neighbours, and sets the normals.
void smooth_positions(std::vector<CurvePoint>& points, int reach) {
  const int n = static_cast<int>(points.size());
  std::vector<Vector2f> positions(points.size());
  for (int i = 0; i < n; ++i) {
    const int r = std::min(reach, n / 2);
    const int low = std::clamp(i - r, 0, std::max(0, n - 1 - 2 * r));
    const int high = std::min(n - 1, low + 2 * r);
    const Vector2f center = points[static_cast<std::size_t>(i)].position;
    const Vector2f tangent = (points[static_cast<std::size_t>(high)].position -
                              points[static_cast<std::size_t>(low)].position)
                                 .normalized();
    const Vector2f normal(tangent.y(), -tangent.x());
    // Least squares for a0 + a1 t + a2 t^2; m[k] is the sum of t^k.
    std::array<float, 5> m{};
    Eigen::Vector3f b = Eigen::Vector3f::Zero();
    for (int j = low; j <= high; ++j) {
      const Vector2f d = points[static_cast<std::size_t>(j)].position - center;
      const float t = d.dot(tangent) * 0.25F;
      const float v = d.dot(normal);
      const float t2 = t * t;
      m[0] += 1;
      m[1] += t;
      m[2] += t2;
      m[3] += t2 * t;
      m[4] += t2 * t2;
      b += Eigen::Vector3f(v, v * t, v * t2);
    }
    Eigen::Matrix3f N;
    N << m[0], m[1], m[2], m[1], m[2], m[3], m[2], m[3], m[4];
    N.diagonal().array() += 1e-3F;
    const Eigen::Vector3f x = N.inverse() * b;
    positions[static_cast<std::size_t>(i)] = center + x[0] * normal;
    const Vector2f slope = tangent + 0.25F * x[1] * normal;
    points[static_cast<std::size_t>(i)].normal = Vector2f(slope.y(), -slope.x()).normalized();
  }
  for (int i = 0; i < n; ++i)
    points[static_cast<std::size_t>(i)].position = positions[static_cast<std::size_t>(i)];
}

struct Fit {
  float amplitude = 0;
  float offset = 0;
  float width = 0;
  float residual2 = 0;    ///< noise variance from the odd part of the residual
  float offset_gain = 0;  ///< variance of offset for unit residual variance
  bool good = false;
};

/// Gauss-Newton for A f((o - x0), s) (1 + g (o - x0)) + c0 + c1 o within +-half px, f being a
/// LineProfile. s is held by a weak prior at `width`, the slope g of the light along the profile by
/// one at 0. c0 and c1 are eliminated: everything is taken without its part in 1 and o.
Fit fit_profile(const Profile& profile, int half, float amplitude, float width) {
  constexpr int kMaxIterations = 8;  // most need two, those of dense lines all
  constexpr float kSmallStep = 0.01F;
  constexpr float kStep = 0.05F;  // px, for derivatives by differences
  const Profile offsets = profile_offsets();
  const Profile inside = (offsets.abs() < static_cast<float>(half) + 0.5F).cast<float>();
  const Profile mean_weights = inside / inside.sum();
  const Profile slope_weights = inside * offsets / (inside * offsets.square()).sum();
  const auto without_background = [&](const Profile& p) -> Profile {
    return inside * (p - (p * mean_weights).sum() - (p * slope_weights).sum() * offsets);
  };
  const Profile measured = without_background(profile);
  float height = std::max(amplitude, 1e-4F);
  float center = 0;
  float s = width;
  float tilt = 0;
  Profile residual = Profile::Zero();
  Eigen::Matrix4f covariance = Eigen::Matrix4f::Zero();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // Derivatives divided by the height: pure numbers whatever the amplitude.
    const LineProfile shape(s);
    const Profile d = offsets - center;
    const Profile e = shape.at(d);
    const Profile light = 1 + tilt * d;
    const std::array<Profile, 4> J = {
        without_background(light * e),
        without_background(light * (shape.at(Profile(d - kStep)) - e) / kStep),
        without_background(light * (LineProfile(s + kStep).at(d) - e) / kStep),
        without_background(d * e)};
    residual = measured - height * J[0];
    Eigen::Matrix4f N;
    Eigen::Vector4f g;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      for (std::size_t j = 0; j <= i; ++j) {
        const auto column = static_cast<Eigen::Index>(j);
        N(row, column) = N(column, row) = (J[i] * J[j]).sum();
      }
      g[row] = (J[i] * residual).sum();
    }
    N(2, 2) += kWidthPrior;
    g[2] += kWidthPrior * height * (width - s);
    N(3, 3) += kTiltPrior;
    g[3] -= kTiltPrior * height * tilt;
    covariance = N.inverse() / (height * height);
    const Eigen::Vector4f step = height * covariance * g;
    const float moved = std::clamp(step[1], -0.7F, 0.7F);
    const float widened = std::clamp(step[2], -0.5F, 0.5F);
    tilt = std::clamp(tilt + step[3], -0.15F, 0.15F);
    height += height * step[0];
    center += moved;
    s = std::clamp(s + widened, kMinWidth, kMaxWidth);
    if (!(height > 1e-5F)) return {};
    if (std::abs(moved) < kSmallStep && std::abs(widened) < 5 * kSmallStep) break;
  }
  Fit fit;
  fit.amplitude = height;
  fit.offset = center;
  fit.width = s;
  fit.offset_gain = covariance(1, 1);
  // Only the odd part of the residual can move the line; the even part holds the misfit of the
  // profile, which is no noise. Two of the parameters (offset, slope) are odd.
  const auto right = residual.segment<kMaxHalf>(kMaxHalf + 1);
  const auto left = residual.head<kMaxHalf>().reverse();
  fit.residual2 = 0.5F * (right - left).square().sum() / static_cast<float>(half - 2);
  fit.good = std::isfinite(center) && std::isfinite(fit.offset_gain) && fit.offset_gain > 0 &&
             std::abs(center) < 1.6F;
  return fit;
}

/// Samples the image across the curve, with the curve's own model added back where `residual` holds
/// the image without all curves.
void sample_profiles(const cv::Mat& residual, const std::vector<CurvePoint>& points, bool add_own,
                     std::vector<Profile>& profiles) {
  profiles.resize(points.size());
  const Profile offsets = profile_offsets();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const CurvePoint& p = points[i];
    Profile& profile = profiles[i];
    for (int o = 0; o <= 2 * kMaxHalf; ++o) {
      const Vector2f at = p.position + static_cast<float>(o - kMaxHalf) * p.normal;
      profile[o] = sample_bilinear(residual, at.x(), at.y());
    }
    profile[2 * kMaxHalf + 1] = 0;
    if (!add_own || p.amplitude <= 0) continue;
    profile += (offsets.abs() <= kModelReach * p.width_px)
                   .select(p.amplitude * LineProfile(p.width_px).at(offsets), 0.F);
  }
}

void fit_curve(const cv::Mat& residual, bool first_round, int half_arc, Curve& curve) {
  std::vector<CurvePoint>& points = curve.points;
  std::vector<Profile> profiles;
  sample_profiles(residual, points, !first_round, profiles);
  const int n = static_cast<int>(points.size());
  std::vector<Fit> fits(points.size());
  for (int i = 0; i < n; ++i) {
    const int r = std::min({half_arc, i, n - 1 - i});  // symmetric: no shift towards the inside
    Profile mean = Profile::Zero();
    for (int j = i - r; j <= i + r; ++j) mean += profiles[static_cast<std::size_t>(j)];
    mean /= static_cast<float>(2 * r + 1);
    const CurvePoint& p = points[static_cast<std::size_t>(i)];
    const float width = p.width_px;
    // At first the neighbours are still in the image: a shorter profile sees less of them.
    const int half = std::clamp(static_cast<int>(std::lround(2.4F * width)) + (first_round ? 0 : 1),
                                4, kMaxHalf);
    const float top = mean[kMaxHalf] - std::min(mean[kMaxHalf - half], mean[kMaxHalf + half]);
    fits[static_cast<std::size_t>(i)] = fit_profile(mean, half, top, width);
  }
  for (int i = 0; i < n; ++i) {
    CurvePoint& p = points[static_cast<std::size_t>(i)];
    const Fit& fit = fits[static_cast<std::size_t>(i)];
    if (!fit.good) {
      p.amplitude = 0;
      p.sigma_px = 1;
      continue;
    }
    // The residual level of one profile has few degrees of freedom: average it along the curve.
    float level = 0;
    int count = 0;
    for (int j = std::max(0, i - 6); j <= std::min(n - 1, i + 6); ++j) {
      if (!fits[static_cast<std::size_t>(j)].good) continue;
      level += fits[static_cast<std::size_t>(j)].residual2;
      ++count;
    }
    p.position += fit.offset * p.normal;
    p.amplitude = fit.amplitude;
    p.width_px = fit.width;
    p.sigma_px = std::sqrt(level / static_cast<float>(count) * fit.offset_gain);
  }
}

/// Running median of widths: the width varies slowly, single fits trade it against the background.
void smooth_widths(std::vector<CurvePoint>& points) {
  constexpr int kReach = 4;
  const int n = static_cast<int>(points.size());
  std::vector<float> widths(points.size());
  for (int i = 0; i < n; ++i) {
    std::array<float, 2 * kReach + 1> window;
    std::size_t count = 0;
    for (int j = std::max(0, i - kReach); j <= std::min(n - 1, i + kReach); ++j) {
      window[count++] = points[static_cast<std::size_t>(j)].width_px;
    }
    std::nth_element(window.begin(), window.begin() + static_cast<std::ptrdiff_t>(count / 2),
                     window.begin() + static_cast<std::ptrdiff_t>(count));
    widths[static_cast<std::size_t>(i)] = window[count / 2];
  }
  for (std::size_t i = 0; i < points.size(); ++i) points[i].width_px = widths[i];
}

bool sound(const CurvePoint& p, const RefineOptions& options) {
  return p.amplitude > 0 && p.sigma_px < options.max_sigma_px && p.width_px > kMinWidth &&
         p.width_px < kMaxWidth;
}

/// True when going from b to c leaves the direction from a to b by a jump.
bool jumps(const CurvePoint& a, const CurvePoint& b) {
  const Vector2f way = b.position - a.position;
  const float along = std::abs(way.dot(a.tangent()));
  const float lateral = std::abs(way.dot(a.normal));
  return way.norm() > 3 || lateral > 0.5F + 0.3F * along;
}

void trim_ends(std::vector<CurvePoint>& points, double ratio) {
  constexpr std::size_t kInward = 5;
  const auto faint = [&](const CurvePoint& end, const CurvePoint& inner) {
    return end.amplitude < static_cast<float>(ratio) * inner.amplitude;
  };
  std::size_t first = 0;
  std::size_t last = points.size();
  while (first + kInward < last && faint(points[first], points[first + kInward])) ++first;
  while (last > first + kInward && faint(points[last - 1], points[last - 1 - kInward])) --last;
  points = std::vector<CurvePoint>(points.begin() + static_cast<std::ptrdiff_t>(first),
                                   points.begin() + static_cast<std::ptrdiff_t>(last));
}

std::vector<Curve> cut_and_trim(const std::vector<Curve>& curves, const RefineOptions& options) {
  std::vector<Curve> result;
  for (const Curve& curve : curves) {
    Curve piece;
    piece.family = curve.family;
    const auto finish = [&] {
      trim_ends(piece.points, options.end_amplitude_ratio);
      if (static_cast<int>(piece.points.size()) >= options.min_points) result.push_back(piece);
      piece.points.clear();
    };
    for (const CurvePoint& p : curve.points) {
      if (!sound(p, options)) {
        finish();
        continue;
      }
      if (!piece.points.empty() && jumps(piece.points.back(), p)) finish();
      piece.points.push_back(p);
    }
    finish();
  }
  return result;
}

/// Adds the profile between two points. Every image row (column for flat pieces) that the segment
/// passes gets it once: the half-open range [from, to) makes neighbouring segments share no row.
void render_segment(const CurvePoint& p, const CurvePoint& q, cv::Mat& model) {
  if (p.amplitude <= 0 || q.amplitude <= 0) return;
  const Vector2f way = q.position - p.position;
  const Eigen::Index major = std::abs(p.normal.y()) < std::abs(p.normal.x()) ? 1 : 0;
  const Eigen::Index minor = 1 - major;
  if (std::abs(way[major]) < 1e-6F) return;
  const float from = std::min(p.position[major], q.position[major]);
  const float to = std::max(p.position[major], q.position[major]);
  const int last_major = major == 1 ? model.rows - 1 : model.cols - 1;
  const int last_minor = major == 1 ? model.cols - 1 : model.rows - 1;
  for (int m = std::max(0, static_cast<int>(std::ceil(from)));
       m <= last_major && static_cast<float>(m) < to; ++m) {
    const float f = (static_cast<float>(m) - p.position[major]) / way[major];
    const float center = p.position[minor] + f * way[minor];
    const float amplitude = p.amplitude + f * (q.amplitude - p.amplitude);
    const float width = p.width_px + f * (q.width_px - p.width_px);
    const float lean = std::abs(p.normal[minor]);
    const float reach = kModelReach * width / lean;
    const int low = std::max(0, static_cast<int>(std::ceil(center - reach)));
    const int high = std::min(last_minor, static_cast<int>(std::floor(center + reach)));
    const LineProfile shape(width);
    for (int k = low; k <= high; ++k) {
      const float d = static_cast<float>(k) - center;
      const float value = amplitude * shape.at(lean * d);
      (major == 1 ? model.at<float>(m, k) : model.at<float>(k, m)) += value;
    }
  }
}

/// The end point of a curve moved outwards: profiles near the end reach beyond it, and what is
/// added back to them must have been subtracted.
CurvePoint beyond(const CurvePoint& end, const CurvePoint& inner) {
  constexpr float kOverhang = 2;
  CurvePoint point = end;
  point.position += kOverhang * (end.position - inner.position).normalized();
  return point;
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

cv::Mat render_curves(const std::vector<Curve>& curves, cv::Size size) {
  cv::Mat model(size, CV_32F, cv::Scalar(0));
  for (const Curve& curve : curves) {
    const std::size_t n = curve.points.size();
    if (n < 2) continue;
    render_segment(beyond(curve.points[0], curve.points[1]), curve.points[0], model);
    for (std::size_t i = 0; i + 1 < n; ++i) {
      render_segment(curve.points[i], curve.points[i + 1], model);
    }
    render_segment(curve.points[n - 1], beyond(curve.points[n - 1], curve.points[n - 2]), model);
  }
  return model;
}

std::vector<Curve> refine_curves(const cv::Mat& presence, std::vector<Curve> curves,
                                 const RefineOptions& options) {
  constexpr int kSmoothingReach = 4;
  for (int round = 0; round < options.rounds; ++round) {
    for (Curve& curve : curves) smooth_positions(curve.points, kSmoothingReach);
    const cv::Mat residual =
        round > 0 ? cv::Mat(presence - render_curves(curves, presence.size())) : presence;
    for (Curve& curve : curves) {
      fit_curve(residual, round == 0, options.half_arc, curve);
      smooth_widths(curve.points);
    }
    curves = cut_and_trim(curves, options);
  }
  return curves;
}

}  // namespace pencilscan
