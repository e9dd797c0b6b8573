#include "pencilscan/detection/refine.h"

#include <Eigen/Cholesky>
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

using Profile = std::array<float, 2 * kMaxHalf + 1>;

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
    Eigen::Matrix3f N = 1e-3F * Eigen::Matrix3f::Identity();
    Eigen::Vector3f b = Eigen::Vector3f::Zero();
    for (int j = low; j <= high; ++j) {
      const Vector2f d = points[static_cast<std::size_t>(j)].position - center;
      const float t = d.dot(tangent) * 0.25F;
      const Eigen::Vector3f row(1, t, t * t);
      N += row * row.transpose();
      b += row * d.dot(normal);
    }
    const Eigen::Vector3f x = N.ldlt().solve(b);
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

/// Gauss-Newton for A exp(-(o - x0)^2 / 2 s^2) + c0 + c1 o; s is held by a weak prior at `width`.
Fit fit_profile(const Profile& profile, int half, float amplitude, float width) {
  using Vec5 = Eigen::Matrix<float, 5, 1>;
  using Mat5 = Eigen::Matrix<float, 5, 5>;
  const float background = 0.5F * (profile[static_cast<std::size_t>(kMaxHalf - half)] +
                                   profile[static_cast<std::size_t>(kMaxHalf + half)]);
  Vec5 x;
  x << std::max(amplitude, 1e-4F), 0, width, std::max(0.F, background - 0.1F * amplitude), 0;
  Mat5 N;
  Profile residual{};
  constexpr int kIterations = 4;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    N.setZero();
    Vec5 g = Vec5::Zero();
    const float s = x[2];
    for (int o = -half; o <= half; ++o) {
      const float d = (static_cast<float>(o) - x[1]) / s;
      const float e = std::exp(-0.5F * d * d);
      const float r = profile[static_cast<std::size_t>(kMaxHalf + o)] -
                      (x[0] * e + x[3] + x[4] * static_cast<float>(o));
      Vec5 row;
      row << e, x[0] * e * d / s, x[0] * e * d * d / s, 1, static_cast<float>(o);
      N.noalias() += row * row.transpose();
      g.noalias() += row * r;
      residual[static_cast<std::size_t>(kMaxHalf + o)] = r;
    }
    Mat5 damped = N;
    const float scale = x[0] * x[0];
    damped(2, 2) += 0.2F * scale;
    g[2] += 0.2F * scale * (width - x[2]);
    damped.diagonal() *= 1.0001F;
    damped(0, 0) += 1e-6F;
    const Vec5 step = damped.ldlt().solve(g);
    x[0] += step[0];
    x[1] += std::clamp(step[1], -0.7F, 0.7F);
    x[2] = std::clamp(x[2] + std::clamp(step[2], -0.5F, 0.5F), kMinWidth, kMaxWidth);
    x[3] += step[3];
    x[4] += step[4];
    if (!(x[0] > 1e-5F)) return {};
  }
  Fit fit;
  fit.amplitude = x[0];
  fit.offset = x[1];
  fit.width = x[2];
  // Only the odd part of the residual can move the line; the even part holds the misfit of a
  // Gaussian to a blurred box, which is no noise. Two of the parameters (offset, slope) are odd.
  float odd2 = 0;
  for (int o = 1; o <= half; ++o) {
    const float d = residual[static_cast<std::size_t>(kMaxHalf + o)] -
                    residual[static_cast<std::size_t>(kMaxHalf - o)];
    odd2 += 0.5F * d * d;
  }
  fit.residual2 = odd2 / static_cast<float>(half - 2);
  N(2, 2) += 0.2F * x[0] * x[0];
  Vec5 unit = Vec5::Zero();
  unit[1] = 1;
  fit.offset_gain = N.ldlt().solve(unit)[1];
  fit.good = std::isfinite(x[1]) && std::isfinite(fit.offset_gain) && fit.offset_gain > 0 &&
             std::abs(x[1]) < 1.6F;
  return fit;
}

/// Samples the image across the curve, with the curve's own model added back where `residual` holds
/// the image without all curves.
void sample_profiles(const cv::Mat& residual, const std::vector<CurvePoint>& points, bool add_own,
                     std::vector<Profile>& profiles) {
  profiles.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const CurvePoint& p = points[i];
    for (int o = -kMaxHalf; o <= kMaxHalf; ++o) {
      const auto fo = static_cast<float>(o);
      float value = sample_bilinear(residual, p.position.x() + fo * p.normal.x(),
                                    p.position.y() + fo * p.normal.y());
      if (add_own && p.amplitude > 0 && std::abs(fo) <= kModelReach * p.width_px) {
        value += p.amplitude * std::exp(-0.5F * fo * fo / (p.width_px * p.width_px));
      }
      profiles[i][static_cast<std::size_t>(o + kMaxHalf)] = value;
    }
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
    Profile mean{};
    for (int j = i - r; j <= i + r; ++j) {
      for (std::size_t o = 0; o < mean.size(); ++o)
        mean[o] += profiles[static_cast<std::size_t>(j)][o];
    }
    for (float& m : mean) m /= static_cast<float>(2 * r + 1);
    const CurvePoint& p = points[static_cast<std::size_t>(i)];
    const float width = p.width_px;
    // At first the neighbours are still in the image: a shorter profile sees less of them.
    const int half = std::clamp(static_cast<int>(std::lround(2.4F * width)) + (first_round ? 0 : 1),
                                4, kMaxHalf);
    const float top = mean[kMaxHalf] - std::min(mean[static_cast<std::size_t>(kMaxHalf - half)],
                                                mean[static_cast<std::size_t>(kMaxHalf + half)]);
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

}  // namespace

float sample_bilinear(const cv::Mat& image, float x, float y) {
  const float fx0 = std::floor(x);
  const float fy0 = std::floor(y);
  const int ix = static_cast<int>(fx0);
  const int iy = static_cast<int>(fy0);
  if (ix < 0 || iy < 0 || ix + 1 >= image.cols || iy + 1 >= image.rows) return 0;
  const float fx = x - fx0;
  const float fy = y - fy0;
  const float* a = image.ptr<float>(iy) + ix;
  const float* b = image.ptr<float>(iy + 1) + ix;
  return (1 - fy) * ((1 - fx) * a[0] + fx * a[1]) + fy * ((1 - fx) * b[0] + fx * b[1]);
}

cv::Mat render_curves(const std::vector<Curve>& curves, cv::Size size) {
  cv::Mat model(size, CV_32F, cv::Scalar(0));
  // Every image row (column for flat pieces) that a segment passes gets the profile once: the
  // half-open range [from, to) makes neighbouring segments share no row.
  for (const Curve& curve : curves) {
    for (std::size_t i = 0; i + 1 < curve.points.size(); ++i) {
      const CurvePoint& p = curve.points[i];
      const CurvePoint& q = curve.points[i + 1];
      if (p.amplitude <= 0 || q.amplitude <= 0) continue;
      const Vector2f way = q.position - p.position;
      const Eigen::Index major = std::abs(p.normal.y()) < std::abs(p.normal.x()) ? 1 : 0;
      const Eigen::Index minor = 1 - major;
      if (std::abs(way[major]) < 1e-6F) continue;
      const float from = std::min(p.position[major], q.position[major]);
      const float to = std::max(p.position[major], q.position[major]);
      const int last_major = major == 1 ? size.height - 1 : size.width - 1;
      const int last_minor = major == 1 ? size.width - 1 : size.height - 1;
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
        const float scale = -0.5F * lean * lean / (width * width);
        for (int k = low; k <= high; ++k) {
          const float d = static_cast<float>(k) - center;
          const float value = amplitude * std::exp(scale * d * d);
          (major == 1 ? model.at<float>(m, k) : model.at<float>(k, m)) += value;
        }
      }
    }
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
