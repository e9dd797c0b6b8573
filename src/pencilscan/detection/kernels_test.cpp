// The kernels of detection against closed forms and against what is slow but plain.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/detection/curve_smoothing.h"
#include "pencilscan/detection/profile_fit.h"
#include "pencilscan/detection/refine.h"
#include "pencilscan/detection/ridge.h"
#include "pencilscan/detection/trace.h"

namespace pencilscan {
namespace {

/// The profile as profile_fit.h defines it, in double: the difference of two logistic steps.
double exact_profile(double width, double d) {
  const double edge = std::min(0.5, 0.5 * width);
  const double half =
      std::sqrt(3 * width * width - std::numbers::pi * std::numbers::pi * edge * edge);
  const auto step = [&](double x) { return 1 / (1 + std::exp(-x / edge)); };
  const auto box = [&](double x) { return step(x + half) - step(x - half); };
  return box(d) / box(0);
}

constexpr std::array<float, 3> kWidths = {1.2F, 2.0F, 3.5F};

TEST(LineProfile, IsTheClosedFormWithItsHeightAndSecondMoment) {
  for (const float width : kWidths) {
    std::array<float, 2 * kLanes> values{};
    line_profile(width, values);
    for (int i = 0; i < 2 * kLanes; ++i) {
      const double d = i - 7;
      if (std::abs(d) > kModelReach * width) continue;
      EXPECT_NEAR(values[static_cast<std::size_t>(i)], exact_profile(width, d), 1e-5);
    }
    double sum = 0;
    double moment = 0;
    for (double d = -40; d <= 40; d += 0.01) {
      sum += exact_profile(width, d);
      moment += d * d * exact_profile(width, d);
    }
    EXPECT_NEAR(std::sqrt(moment / sum), width, 1e-3);
  }
}

TEST(LineProfile, AddedToAnImageIsTheSameProfile) {
  for (const float width : kWidths) {
    std::vector<float> image(80, 0.5F);
    add_line_profile(0.7F, width, -2.6F, 0.4F, 13, image.data() + 3, 2);
    for (int i = 0; i < 13; ++i) {
      const auto at = static_cast<std::size_t>(3 + 2 * i);
      EXPECT_NEAR(image[at], 0.5 + 0.7 * exact_profile(width, -2.6 + 0.4 * i), 1e-5);
      EXPECT_EQ(image[at + 1], 0.5F);  // between the strides
    }
  }
}

TEST(FitProfiles, FindsTheParametersThatMadeTheProfile) {
  ProfileBatch batch{};
  std::array<double, kLanes> offset{};
  std::array<double, kLanes> amplitude{};
  std::array<double, kLanes> width{};
  Random random(5);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    offset[lane] = random.uniform(-0.8, 0.8);
    amplitude[lane] = random.uniform(0.1, 0.8);
    width[lane] = random.uniform(1.2, 1.8);
    const double level = random.uniform(0, 0.1);
    const double slope = random.uniform(-0.01, 0.01);
    for (int i = 0; i < kProfileSize; ++i) {
      const double d = i - kMaxHalf;
      batch.value[static_cast<std::size_t>(i)][lane] = static_cast<float>(
          amplitude[lane] * exact_profile(width[lane], d - offset[lane]) + level + slope * d);
    }
    batch.half[lane] = kMaxHalf;
    batch.amplitude[lane] = static_cast<float>(0.8 * amplitude[lane]);
    batch.width[lane] = static_cast<float>(width[lane]);
  }
  ProfileFits fits{};
  fit_profiles(batch, fits);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    ASSERT_NE(fits.good[lane], 0);
    EXPECT_NEAR(fits.offset[lane], offset[lane], 0.01) << lane;
    EXPECT_NEAR(fits.amplitude[lane] / amplitude[lane], 1, 0.05) << lane;
    EXPECT_NEAR(fits.width[lane], width[lane], 0.1) << lane;
    EXPECT_LT(std::sqrt(fits.residual2[lane]), 0.02 * amplitude[lane]) << lane;
  }
}

/// A line of Gaussian profile through the middle of an image, its normal at `angle`.
cv::Mat gaussian_line(double width, double angle, int size) {
  cv::Mat image(size, size, CV_32F);
  const double middle = 0.5 * (size - 1);
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) {
      const double d = (u - middle) * std::cos(angle) + (v - middle) * std::sin(angle);
      image.at<float>(v, u) = static_cast<float>(std::exp(-d * d / (2 * width * width)));
    }
  }
  return image;
}

// Gauss's bell of width s smoothed by one of width t has the height s / q, q^2 = s^2 + t^2, and
// the second derivative -s / q^3 in its middle.
TEST(FindRidgels, LieOnTheLineWithTheSecondDerivativeOfASmoothedOne) {
  constexpr int kSize = 120;
  constexpr double kWidth = 1.5;
  RidgeOptions options;
  options.widest_px = 4;  // full size only
  const double q = std::hypot(kWidth, options.sigma_across_px);
  for (const double degrees : {0.0, 15.0, 37.0, 90.0, 128.0}) {
    const double angle = degrees * std::numbers::pi / 180;
    const auto ridgels = find_ridgels(gaussian_line(kWidth, angle, kSize), options);
    std::size_t checked = 0;
    for (const Ridgel& r : ridgels) {
      const double middle = 0.5 * (kSize - 1);
      if (std::hypot(r.x - middle, r.y - middle) > 40) continue;
      ++checked;
      const double d = (r.x - middle) * std::cos(angle) + (r.y - middle) * std::sin(angle);
      EXPECT_NEAR(d, 0, 0.15) << degrees;  // before the profile is fitted
      EXPECT_GT(std::abs(r.nx * std::cos(angle) + r.ny * std::sin(angle)), std::cos(0.1));
      // Taps along the line stand on whole pixels, up to half a pixel beside it.
      EXPECT_NEAR(r.response / (kWidth / (q * q * q)), 1, 0.2) << degrees;
    }
    EXPECT_GT(checked, 60U) << degrees;
  }
}

TEST(TraceCurves, LinksTheRidgelsOfTwoLinesIntoTwoCurvesInOrder) {
  std::vector<Ridgel> ridgels;
  for (int i = 0; i < 60; ++i) {
    if (i >= 28 && i < 31) continue;  // a gap that is bridged
    const auto y = static_cast<float>(10 + i);
    ridgels.push_back({20 + 0.2F * static_cast<float>(i), y, 0.98F, -0.196F, 1, 1.5F, 1});
    ridgels.push_back({50, y, 1, 0, 1, 1.5F, 1});
  }
  const std::vector<Curve> curves = trace_curves(ridgels, {80, 80});
  ASSERT_EQ(curves.size(), 2U);
  for (const Curve& curve : curves) {
    EXPECT_GE(curve.points.size(), 57U);
    const bool is_slanted = curve.points.front().position.x() < 45;
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      const auto& x = curve.points[i].position;
      EXPECT_NEAR(x.x(), is_slanted ? 20 + 0.2F * (x.y() - 10) : 50, 0.05);
      if (i == 0) continue;
      EXPECT_LT((x - curve.points[i - 1].position).norm(), 5);
    }
  }
}

/// A box of `width` with edges blurred by `blur`, its normal at `angle`, in noise that grows with
/// the light as a sensor's does.
cv::Mat blurred_box(double width, double blur, double angle, cv::Size size, double noise) {
  cv::Mat image(size, CV_32F);
  const auto step = [&](double d) { return 0.5 * (1 + std::erf(d / (blur * std::sqrt(2.0)))); };
  for (int v = 0; v < size.height; ++v) {
    Random random(11, static_cast<std::uint64_t>(v));
    for (int u = 0; u < size.width; ++u) {
      const double d =
          (u - 0.5 * size.width) * std::cos(angle) + (v - 0.5 * size.height) * std::sin(angle);
      const double light = step(d + width / 2) - step(d - width / 2);
      image.at<float>(v, u) = static_cast<float>(0.01 + 0.5 * light +
                                                 random.normal(0, noise * std::sqrt(0.05 + light)));
    }
  }
  return image;
}

std::vector<Curve> curves_of_all_sizes(const cv::Mat& image) {
  const std::vector<Ridgel> ridgels = find_ridgels(image);
  RefineOptions options;
  options.sizes = sizes_of(ridgels);
  return refine_curves(image, trace_curves(ridgels, image.size()), options);
}

TEST(FindRidgels, CoarseSizesChangeNothingInAPictureOfNarrowLinesAndShowWideOnes) {
  const cv::Size size(200, 160);
  const cv::Mat narrow = blurred_box(3, 0.7, 0.4, size, 0.005);
  RidgeOptions up_to_half;
  up_to_half.widest_px = 8;
  const std::vector<Ridgel> expected = find_ridgels(narrow, up_to_half);
  const std::vector<Ridgel> found = find_ridgels(narrow);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].x, expected[i].x);
    EXPECT_EQ(found[i].y, expected[i].y);
    EXPECT_EQ(found[i].scale, 1);
  }
  EXPECT_EQ(sizes_of(found), 1);
  EXPECT_EQ(sizes_of(find_ridgels(blurred_box(7, 1.5, 0.4, size, 0.005))), 2);
  EXPECT_EQ(sizes_of(find_ridgels(blurred_box(30, 6, 0.4, size, 0.005))), 4);
}

TEST(FindRidgels, LinesThatTheRigSaysAreWideAreNotCutBetweenTwoSizes) {
  // As wide as where the next size begins to show lines better.
  const cv::Mat image = blurred_box(4.3, 0.9, 0.4, {260, 200}, 0.02);
  const auto share_of_half_size = [&](double usual_px) {
    RidgeOptions options;
    options.usual_px = usual_px;
    double half = 0;
    double all = 0;
    for (const Ridgel& r : find_ridgels(image, options)) {
      all += static_cast<double>(r.scale);
      half += r.scale == 2 ? 2 : 0;
    }
    return half / all;
  };
  EXPECT_LT(share_of_half_size(4.3), 0.1);  // a picture of narrow lines
  EXPECT_LT(share_of_half_size(7.0), 0.1);
  EXPECT_GT(share_of_half_size(7.6), 0.9);
}

TEST(FindRidgels, ALineGoesOnWhereTheSurfaceTurnsAwayAndItIsWiderAndDimmer) {
  const cv::Size size(200, 240);
  const int turn = size.height / 2;  // the row
  cv::Mat image = blurred_box(12, 1, 0, size, 0.005);
  cv::Mat turned = 0.4 * blurred_box(26, 1, 0, size, 0.005);
  turned.rowRange(turn, size.height).copyTo(image.rowRange(turn, size.height));
  RidgeOptions options;
  options.usual_px = 12;
  int middle = 0;
  int edge = 0;
  for (const Ridgel& r : find_ridgels(image, options)) {
    if (r.y < static_cast<float>(turn + 8) || r.y > static_cast<float>(turn + 48)) continue;
    (std::abs(r.x - 0.5F * static_cast<float>(size.width)) < 4 ? middle : edge) +=
        static_cast<int>(r.scale);
  }
  EXPECT_GT(middle, 30);  // of 40 rows
  EXPECT_LT(edge, 5);
}

// From lines that are as narrow as a picture can show them to those that are ten times as wide as
// usual, sharp or without any flat top.
TEST(RefineCurves, ALineOfAnyWidthIsOneCurveInItsMiddle) {
  constexpr double kNoise = 0.005;
  // Root of the mean square; a line's noise moves it by a share of its width.
  constexpr double kLargestErrorPx = 0.05;
  constexpr double kLargestErrorOfWidth = 0.005;
  const cv::Size size(260, 200);
  for (const double width : {2, 3, 4, 5, 6, 8, 10, 13, 17, 22, 28, 34, 40}) {
    for (const double share : {0.0, 0.2, 0.45}) {
      for (const double degrees : {0.0, 23.0, 90.0}) {
        SCOPED_TRACE("width " + std::to_string(width) + ", blur of it " + std::to_string(share) +
                     ", degrees " + std::to_string(degrees));
        const double angle = degrees * std::numbers::pi / 180;
        const double blur = std::hypot(0.7, share * width);
        const cv::Mat image = blurred_box(width, blur, angle, size, kNoise);
        const std::vector<Curve> curves = curves_of_all_sizes(image);
        // Towards the image's border profiles are cut off.
        const double length = 80 - width;
        int pieces = 0;
        double points = 0;
        double square = 0;
        for (const Curve& curve : curves) {
          const double before = points;
          for (const CurvePoint& p : curve.points) {
            const double x = p.position.x() - 0.5 * size.width;
            const double y = p.position.y() - 0.5 * size.height;
            if (std::abs(y * std::cos(angle) - x * std::sin(angle)) > length) continue;
            const double d = x * std::cos(angle) + y * std::sin(angle);
            points += 1;
            square += d * d;
          }
          pieces += points > before ? 1 : 0;
        }
        EXPECT_EQ(pieces, 1);
        EXPECT_GT(points, 0.95 * 2 * length);
        EXPECT_LT(std::sqrt(square / points), kLargestErrorPx + kLargestErrorOfWidth * width);
      }
    }
  }
}

/// A vertical line 3 px wide whose light is missing over `gap` px around the middle row.
cv::Mat line_with_gap(double gap, cv::Size size, double noise) {
  cv::Mat image(size, CV_32F);
  const auto step = [&](double d) { return 0.5 * (1 + std::erf(d / std::sqrt(2.0) / 0.7)); };
  for (int v = 0; v < size.height; ++v) {
    Random random(5, static_cast<std::uint64_t>(v));
    const double y = v - 0.5 * size.height;
    const double lit = 1 - (step(y + gap / 2) - step(y - gap / 2));
    for (int u = 0; u < size.width; ++u) {
      const double x = u - 0.5 * size.width;
      const double light = step(x + 1.5) - step(x - 1.5);
      image.at<float>(v, u) =
          static_cast<float>(0.01 + 0.5 * lit * light + random.normal(0, noise));
    }
  }
  return image;
}

/// Rows of the image that have a point of the line in its middle.
std::vector<int> rows_with_points(const cv::Mat& image) {
  std::vector<int> rows;
  for (const Curve& curve : curves_of_all_sizes(image)) {
    for (const CurvePoint& p : curve.points) {
      if (std::abs(p.position.x() - 0.5F * static_cast<float>(image.cols)) < 1)
        rows.push_back(static_cast<int>(std::lround(p.position.y())));
    }
  }
  return rows;
}

// Filters and fits average over more of a line than such a gap is long.
TEST(RefineCurves, AGapInALineHasNoPoints) {
  const cv::Size size(60, 120);
  for (const double gap : {5.0, 8.0}) {
    SCOPED_TRACE(gap);
    const std::vector<int> rows = rows_with_points(line_with_gap(gap, size, 0.01));
    EXPECT_GT(rows.size(), 90U - static_cast<std::size_t>(gap));
    for (const int row : rows) {
      // A point stands for the pixel around it: half of it may be lit.
      EXPECT_GE(std::abs(row - 0.5 * size.height), gap / 2 - 1) << row;
    }
  }
}

TEST(RefineCurves, NoiseMakesNoGapInALine) {
  const cv::Size size(60, 400);
  // Up to noise in which a point of the line is 3 deviations high.
  for (const double noise : {0.01, 0.05, 0.15}) {
    SCOPED_TRACE(noise);
    const std::size_t lit = rows_with_points(line_with_gap(0, size, noise)).size();
    EXPECT_GT(lit, 0.95 * size.height);
  }
}

TEST(SmoothPositions, KeepsParabolasAndHalvesNoise) {
  const auto parabola = [](int i) {
    const float t = static_cast<float>(i) - 20;
    return Eigen::Vector2f(t, 0.004F * t * t);
  };
  std::vector<CurvePoint> clean(41);
  for (int i = 0; i < 41; ++i) clean[static_cast<std::size_t>(i)].position = parabola(i);
  std::vector<CurvePoint> noisy = clean;
  Random random(3);
  double before = 0;
  for (CurvePoint& p : noisy) {
    const auto e = static_cast<float>(random.normal(0, 0.05));
    p.position.y() += e;
    before += e * e;
  }
  smooth_positions(clean);
  smooth_positions(noisy);
  double after = 0;
  for (int i = 0; i < 41; ++i) {
    const auto k = static_cast<std::size_t>(i);
    EXPECT_NEAR((clean[k].position - parabola(i)).norm(), 0, 0.002) << i;
    const float off =
        noisy[k].position.y() - 0.004F * noisy[k].position.x() * noisy[k].position.x();
    after += off * off;
  }
  EXPECT_LT(std::sqrt(after), 0.7 * std::sqrt(before));
}

TEST(SmoothWidths, IsARunningMedianOfNine) {
  std::vector<CurvePoint> points(40);
  Random random(9);
  for (CurvePoint& p : points) p.width_px = static_cast<float>(random.uniform(1, 3));
  std::vector<float> widths;
  for (const CurvePoint& p : points) widths.push_back(p.width_px);
  smooth_widths(points);
  for (std::size_t i = 4; i + 4 < points.size(); ++i) {
    std::vector<float> nine(widths.begin() + static_cast<std::ptrdiff_t>(i) - 4,
                            widths.begin() + static_cast<std::ptrdiff_t>(i) + 5);
    std::nth_element(nine.begin(), nine.begin() + 4, nine.end());
    EXPECT_EQ(points[i].width_px, nine[4]) << i;
  }
}

}  // namespace
}  // namespace pencilscan
