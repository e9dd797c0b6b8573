#include "pencilscan/detection/code_evidence.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/detection/nearest.h"
#include "pencilscan/detection/refine.h"

namespace pencilscan {
namespace {

constexpr int kHalf = 4;      ///< profile half-length, px
constexpr int kUnknowns = 4;  ///< own line, other families, background level and slope

using Normal = Eigen::Matrix<float, kUnknowns, kUnknowns>;
using Right = Eigen::Matrix<float, kUnknowns, 3>;

struct Sums {
  Normal normal = Normal::Zero();
  Right right = Right::Zero();
};

Sums point_sums(const cv::Mat& image, const cv::Mat& others, const CurvePoint& p) {
  Sums sums;
  for (int o = -kHalf; o <= kHalf; ++o) {
    const auto fo = static_cast<float>(o);
    const int x = nearest(p.position.x() + fo * p.normal.x());
    const int y = nearest(p.position.y() + fo * p.normal.y());
    if (x < 0 || y < 0 || x >= image.cols || y >= image.rows) continue;
    const float d = (static_cast<float>(x) - p.position.x()) * p.normal.x() +
                    (static_cast<float>(y) - p.position.y()) * p.normal.y();
    Eigen::Matrix<float, kUnknowns, 1> row;
    row << std::exp(-0.5F * d * d / (p.width_px * p.width_px)), others.at<float>(y, x), 1,
        d / static_cast<float>(kHalf);
    const auto& pixel = image.at<cv::Vec3f>(y, x);
    sums.normal.noalias() += row * row.transpose();
    sums.right.noalias() += row * Eigen::RowVector3f(pixel[0], pixel[1], pixel[2]);
  }
  return sums;
}

/// Colour amplitude of each point of a curve and the variance gain of its estimate.
struct ColorAmplitude {
  Eigen::Vector3f rgb = Eigen::Vector3f::Zero();
};

std::vector<ColorAmplitude> color_amplitudes(const cv::Mat& image, const cv::Mat& others,
                                             const Curve& curve, int half_arc) {
  std::vector<Sums> sums;
  sums.reserve(curve.points.size());
  for (const CurvePoint& p : curve.points) sums.push_back(point_sums(image, others, p));
  const int n = static_cast<int>(sums.size());
  std::vector<ColorAmplitude> result(sums.size());
  for (int i = 0; i < n; ++i) {
    Normal normal = 1e-4F * Normal::Identity();
    Right right = Right::Zero();
    for (int j = std::max(0, i - half_arc); j <= std::min(n - 1, i + half_arc); ++j) {
      normal += sums[static_cast<std::size_t>(j)].normal;
      right += sums[static_cast<std::size_t>(j)].right;
    }
    // The others' coefficient lies between 0 and about 1: a ridge keeps it there when unobserved.
    normal(1, 1) += 1e-3F;
    result[static_cast<std::size_t>(i)].rgb = right.transpose() * normal.inverse().col(0);
  }
  return result;
}

Eigen::Vector3f color_vector(const std::string& name) {
  const Rgb rgb = color_from_name(name).value_or(Rgb{0, 0, 0});
  return {static_cast<float>(rgb[0]), static_cast<float>(rgb[1]), static_cast<float>(rgb[2])};
}

/// Median over points of channel / presence amplitude, among points where it exceeds half of what
/// the colour says: how bright each channel is on this object in this camera.
Eigen::Vector3f channel_gains(const std::vector<std::vector<ColorAmplitude>>& amplitudes,
                              const std::vector<const Curve*>& curves, const Vec3& presence) {
  Eigen::Vector3f gains(1, 1, 1);
  for (int c = 0; c < 3; ++c) {
    std::vector<float> ratios;
    for (std::size_t k = 0; k < curves.size(); ++k) {
      for (std::size_t i = 0; i < amplitudes[k].size(); ++i) {
        const Eigen::Vector3f& rgb = amplitudes[k][i].rgb;
        const float own = static_cast<float>(presence.dot(rgb.cast<double>()));
        if (own > 0 && rgb[c] > 0.5F * own && rgb[c] < 3 * own) ratios.push_back(rgb[c] / own);
      }
    }
    if (ratios.size() < 100) continue;
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    gains[c] = *middle;
  }
  return gains;
}

}  // namespace

void measure_code(const cv::Mat& unmixed_image, const std::vector<ColorFamily>& families,
                  std::vector<Curve>& curves, const CodeEvidenceOptions& options) {
  std::vector<cv::Mat> models;
  for (std::size_t f = 0; f < families.size(); ++f) {
    std::vector<Curve> of_family;
    for (const Curve& c : curves) {
      if (c.family == static_cast<int>(f)) of_family.push_back(c);
    }
    models.push_back(render_curves(of_family, unmixed_image.size()));
  }
  for (std::size_t f = 0; f < families.size(); ++f) {
    const ColorFamily& family = families[f];
    cv::Mat others(unmixed_image.size(), CV_32F, cv::Scalar(0));
    for (std::size_t g = 0; g < families.size(); ++g) {
      if (g != f) others += models[g];
    }
    std::vector<const Curve*> own;
    std::vector<std::vector<ColorAmplitude>> amplitudes;
    for (const Curve& c : curves) {
      if (c.family != static_cast<int>(f)) continue;
      own.push_back(&c);
      amplitudes.push_back(color_amplitudes(unmixed_image, others, c, options.half_arc));
    }
    const Eigen::Vector3f gains = channel_gains(amplitudes, own, family.presence);
    std::size_t k = 0;
    for (Curve& curve : curves) {
      if (curve.family != static_cast<int>(f)) continue;
      const auto& measured = amplitudes[k++];
      curve.code.assign(curve.points.size() * family.colors.size(), 0.F);
      for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const Eigen::Vector3f rgb = measured[i].rgb.cwiseQuotient(gains);
        const float noise =
            static_cast<float>(options.relative_noise) * std::max(rgb.norm(), 1e-4F);
        float* row = curve.code.data() + i * family.colors.size();
        float best = -1e9F;
        for (std::size_t j = 0; j < family.colors.size(); ++j) {
          const Eigen::Vector3f c = color_vector(family.colors[j]);
          const float scale = std::max(0.F, rgb.dot(c) / c.squaredNorm());
          row[j] = -0.5F * (rgb - scale * c).squaredNorm() / (noise * noise);
          best = std::max(best, row[j]);
        }
        for (std::size_t j = 0; j < family.colors.size(); ++j) {
          row[j] = std::max(row[j] - best, -static_cast<float>(options.max_log_ratio));
        }
      }
    }
  }
}

}  // namespace pencilscan
