#include "pencilscan/gray/gray_decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/gray/image_order.h"
#include "pencilscan/gray/local_map.h"
#include "pencilscan/gray/swapped_bits.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

constexpr int kPanelWidth = 200;
constexpr int kPanelHeight = 120;
constexpr int kSize = 96;

struct Scene {
  double ambient = 0;
  double contrast = 0.6;
  double noise = 0.004;
  double blur = 0.55;     ///< of the camera, px
  double gamma = 1;       ///< stored = light^(1/gamma)
  double full_scale = 1;  ///< clipped there
  bool inverses = true;
  bool rounded = true;  ///< to 8 bit
};

/// A smooth map from camera to panel, with a step in depth at u = 64.
Vec2 true_panel(double u, double v) {
  const double shift = u < 64 ? 0 : 31.3;
  return {20 + 0.9 * u + 0.07 * v + 0.002 * u * u + shift, 15 - 0.05 * u + 0.8 * v};
}

bool is_lit(double u, double v) { return u > 6 && v > 5 && v < 88; }

/// Light of one image at a panel coordinate, blurred along it: a product of box edges.
double pattern_light(const GrayCodeImage& image, const Vec2& panel, double blur) {
  if (image.kind == GrayCodeImage::Kind::kWhite) return 1;
  if (image.kind == GrayCodeImage::Kind::kBlack) return 0;
  const double x = panel[image.axis == Axis::kColumn ? 0 : 1];
  const int size = image.axis == Axis::kColumn ? kPanelWidth : kPanelHeight;
  const auto below = [&](double edge) { return 0.5 * std::erfc((x - edge) / blur / M_SQRT2); };
  double light = 0;
  for (int i = std::max(0, static_cast<int>(x) - 6); i < std::min(size, static_cast<int>(x) + 7);
       ++i) {
    if (image.bright(i)) light += below(i + 0.5) - below(i - 0.5);
  }
  return light;
}

GrayImageSource images_of(const Scene& scene) {
  return [scene](std::size_t number) {
    const auto sequence = gray_code_sequence(kPanelWidth, kPanelHeight, scene.inverses);
    Random random(7, number);
    // The camera's lens blurs what the surface reflects: three samples per pixel and axis.
    constexpr int kFine = 3;
    constexpr double kProjectorBlur = 0.25;  // panel px
    cv::Mat fine(kFine * kSize, kFine * kSize, CV_32FC1, cv::Scalar(scene.ambient));
    for (int y = 0; y < fine.rows; ++y) {
      for (int x = 0; x < fine.cols; ++x) {
        const double u = (x - 1.0) / kFine;
        const double v = (y - 1.0) / kFine;
        if (!is_lit(u, v)) continue;
        const double albedo = 0.7 + 0.3 * std::sin(0.3 * u) * std::cos(0.2 * v);
        fine.at<float>(y, x) +=
            static_cast<float>(albedo * scene.contrast *
                               pattern_light(sequence[number], true_panel(u, v), kProjectorBlur));
      }
    }
    cv::GaussianBlur(fine, fine, {}, kFine * scene.blur);
    cv::Mat image(kSize, kSize, CV_32FC1);
    for (int v = 0; v < kSize; ++v) {
      for (int u = 0; u < kSize; ++u) {
        const auto light = static_cast<double>(fine.at<float>(kFine * v + 1, kFine * u + 1));
        double value = std::pow(std::min(light, scene.full_scale), 1 / scene.gamma) +
                       random.normal(0, scene.noise);
        if (scene.rounded) value = std::round(value * 255) / 255;
        image.at<float>(v, u) = static_cast<float>(std::clamp(value, 0.0, 1.0));
      }
    }
    return image;
  };
}

DecodedView decoded(const Scene& scene) {
  return decode_gray_stack(
      make_gray_stack(kPanelWidth, kPanelHeight, scene.inverses, images_of(scene)));
}

struct Quality {
  double kept = 0;   ///< share of lit pixels
  double gross = 0;  ///< share of them more than 2 panel px off
};

Quality quality_of(const DecodedView& view) {
  int lit = 0;
  int kept = 0;
  int gross = 0;
  for (int v = 0; v < kSize; ++v) {
    for (int u = 0; u < kSize; ++u) {
      lit += is_lit(u, v) ? 1 : 0;
      if (!view.valid(u, v)) continue;
      const Vec2 code(view.code[0](v, u), view.code[1](v, u));
      ++kept;
      gross += (code - true_panel(u, v)).cwiseAbs().maxCoeff() > 2 ? 1 : 0;
    }
  }
  return {static_cast<double>(kept) / lit, static_cast<double>(gross) / std::max(kept, 1)};
}

/// What the project asks of real captures.
constexpr double kLeastKept = 0.90;
constexpr double kMostGross = 0.003;

class GrayDecodeTest : public ::testing::TestWithParam<Scene> {};

TEST_P(GrayDecodeTest, KeepsLitPixelsWithFewGrossErrors) {
  const Quality quality = quality_of(decoded(GetParam()));
  EXPECT_GE(quality.kept, kLeastKept);
  EXPECT_LE(quality.gross, kMostGross);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, GrayDecodeTest,
    ::testing::Values(Scene{}, Scene{.ambient = 0.4}, Scene{.contrast = 0.06},
                      Scene{.contrast = 1.3}, Scene{.noise = 0.02}, Scene{.blur = 1.0},
                      Scene{.gamma = 2.2}, Scene{.inverses = false},
                      Scene{.ambient = 0.2, .contrast = 0.15, .inverses = false},
                      Scene{.noise = 0.001, .rounded = false}));

/// Cameras of 10, 12 or 14 bits leave their values in the low ones of 16, or fill these.
Rig rig_of_one_pair() {
  Rig rig;
  rig.cameras.emplace_back();
  rig.cameras[0].name = "cam0";
  rig.cameras[0].width = rig.cameras[0].height = kSize;
  rig.projectors.emplace_back();
  rig.projectors[0].name = "proj0";
  rig.projectors[0].width = kPanelWidth;
  rig.projectors[0].height = kPanelHeight;
  return rig;
}

TEST(GrayStack, ValuesOfASensorFillItsRange) {
  const TemporaryFolder folder("gray_stack");
  Rig rig = rig_of_one_pair();
  rig.cameras[0].black_level = 64. / 65535;
  Scene scene;
  scene.rounded = false;
  const GrayImageSource images = images_of(scene);
  const std::size_t count = gray_code_sequence(kPanelWidth, kPanelHeight, true).size();
  write_text(folder.path() / "proj0/capture.json", "{}");  // of whoever took them; nobody reads it
  for (const double full : {1023., 4095., 65535.}) {
    for (std::size_t i = 0; i < count; ++i) {
      cv::Mat stored;
      images(i).convertTo(stored, CV_16U, full - 64, 64);
      const std::string number = std::to_string(1000 + i).substr(1) + ".png";
      write_image(folder.path() / "proj0/cam0" / number, stored);
    }
    const auto pairs = list_captures(folder.path(), rig);
    ASSERT_EQ(pairs.size(), 1U);
    const GrayStack stack = read_gray_stack(pairs[0], rig);
    EXPECT_LT(cv::norm(stack.white, images(0), cv::NORM_INF), 1 / full);
    const Quality quality = quality_of(decode_gray_stack(stack));
    EXPECT_GE(quality.kept, kLeastKept) << full;
    EXPECT_LE(quality.gross, kMostGross) << full;
  }
}

TEST(GrayStack, WithoutInversesPatternsAreComparedAsLight) {
  const TemporaryFolder folder("gray_gamma");
  Rig rig = rig_of_one_pair();
  rig.cameras[0].gamma = 2.2;
  const Scene light{.noise = 0, .inverses = false, .rounded = false};
  Scene stored = light;
  stored.gamma = 2.2;
  const std::size_t count = gray_code_sequence(kPanelWidth, kPanelHeight, false).size();
  for (std::size_t i = 0; i < count; ++i) {
    const std::string number = std::to_string(1000 + i).substr(1) + ".png";
    write_image(folder.path() / "proj0/cam0" / number, images_of(stored)(i), 16);
  }
  const auto pairs = list_captures(folder.path(), rig);
  ASSERT_EQ(pairs.size(), 1U);
  const GrayStack stack = read_gray_stack(pairs[0], rig);
  const GrayStack expected = make_gray_stack(kPanelWidth, kPanelHeight, false, images_of(light));
  for (std::size_t axis = 0; axis < 2; ++axis)
    for (std::size_t bit = 0; bit < stack.difference[axis].size(); ++bit)
      EXPECT_LT(cv::norm(stack.difference[axis][bit], expected.difference[axis][bit], cv::NORM_INF),
                1e-3)
          << axis << " " << bit;
}

TEST(GrayDecode, UnlitPixelsSayWhy) {
  const DecodedView view = decoded({});
  EXPECT_EQ(static_cast<PixelState>(view.state(1, 1)), PixelState::kUnlit);
  EXPECT_EQ(static_cast<PixelState>(view.state(93, 40)), PixelState::kUnlit);
  EXPECT_GT(view.counts[static_cast<std::size_t>(PixelState::kUnlit)], 1000U);
}

TEST(GrayDecode, PixelsThatOutshineTheSensorAreSaturated) {
  const DecodedView view = decoded({.ambient = 1.2, .noise = 0.0005});
  EXPECT_EQ(static_cast<PixelState>(view.state(40, 40)), PixelState::kSaturated);
}

TEST(GrayDecode, SameBytesEveryTime) {
  const DecodedView a = decoded({.noise = 0.02});
  const DecodedView b = decoded({.noise = 0.02});
  EXPECT_EQ(cv::countNonZero(a.state != b.state), 0);
  EXPECT_EQ(cv::countNonZero(a.code[0] != b.code[0]), 0);
}

/// Errors of sub-pixel coordinates on a lattice, in pixels and in stated deviations.
struct SubPixel {
  std::size_t count = 0;
  double median = 0;             ///< px
  double worst = 0;              ///< px, 98th percentile
  double median_deviations = 0;  ///< 0.67 for normal errors with the right deviations
  double beyond_three = 0;       ///< share beyond three deviations
};

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

SubPixel sub_pixel_errors(const Scene& scene) {
  const DecodedView view = decoded(scene);
  std::vector<double> errors;
  std::vector<double> ratios;
  for (int v = 12; v < 84; v += 4) {
    for (int u = 12; u < 92; u += 4) {
      const auto map = LocalMap::fit(view, u, v);
      if (!map) continue;
      const Vec2 error = (map->panel_from_camera(Vec2(u, v)) - true_panel(u, v)).cwiseAbs();
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        errors.push_back(error[axis]);
        ratios.push_back(error[axis] / map->sigma_panel_px()[axis]);
      }
    }
  }
  const auto beyond = std::count_if(ratios.begin(), ratios.end(), [](double r) { return r > 3; });
  return {errors.size(), percentile(errors, 0.5), percentile(errors, 0.98), percentile(ratios, 0.5),
          static_cast<double>(beyond) / static_cast<double>(ratios.size())};
}

TEST(LocalMap, SubPixelCoordinatesAreRightWithinTheirDeviations) {
  for (const Scene& scene : {Scene{}, Scene{.ambient = 0.2, .contrast = 0.2},
                             Scene{.inverses = false}, Scene{.gamma = 2.2}}) {
    const SubPixel errors = sub_pixel_errors(scene);
    EXPECT_GT(errors.count, 400U);
    EXPECT_LT(errors.median, 0.02);  // a code alone errs by 0.25 at the median
    EXPECT_LT(errors.worst, 0.12);
    // The stated ones are neither timid (texture makes the tails heavier than the middle)
    EXPECT_GT(errors.median_deviations, 0.2);
    EXPECT_LT(errors.median_deviations, 1.1);  // nor bold
    EXPECT_LT(errors.beyond_three, 0.08);
  }
}

/// A surface whose brightness grows by exp(g) per camera px along u, blurred by b: in closed form,
///   integral of exp(g t) [t < e] over a Gaussian at u = exp(g u + g^2 b^2 / 2) Phi((e - u) / b - g
///   b).
TEST(Crossings, ShadingDoesNotMoveThem) {
  constexpr double kGrowth = 0.04;
  constexpr double kBlur = 0.75;
  constexpr double kColumnsPerPixel = 0.9;
  const auto sequence = gray_code_sequence(kPanelWidth, kPanelHeight);
  const auto image = [&](std::size_t number) {
    const GrayCodeImage& shown = sequence[number];
    const bool of_columns = shown.axis == Axis::kColumn;
    cv::Mat result(kSize, kSize, CV_32FC1);
    for (int v = 0; v < kSize; ++v) {
      for (int u = 0; u < kSize; ++u) {
        // Camera px of a panel edge, and how much of the light lies before it.
        const double at = of_columns ? u : v;
        const double per_px = of_columns ? kColumnsPerPixel : 0.8;
        const double growth = of_columns ? kGrowth : 0;
        const auto before = [&](double edge) {
          const double e = (edge - 20) / per_px;
          return 0.5 * std::erfc(-((e - at) / kBlur - growth * kBlur) / M_SQRT2);
        };
        const int first = static_cast<int>(20 + per_px * at);
        const int size = of_columns ? kPanelWidth : kPanelHeight;
        double light = shown.kind == GrayCodeImage::Kind::kWhite ? 1 : 0;
        if (shown.kind == GrayCodeImage::Kind::kBit)
          for (int i = std::max(first - 8, 0); i < std::min(first + 9, size); ++i)
            if (shown.bright(i)) light += before(i + 0.5) - before(i - 0.5);
        result.at<float>(v, u) = static_cast<float>(0.02 + 0.01 * std::exp(kGrowth * u) * light);
      }
    }
    return result;
  };
  const DecodedView view =
      decode_gray_stack(make_gray_stack(kPanelWidth, kPanelHeight, true, image));
  std::vector<double> errors;
  for (int v = 20; v < 80; ++v) {
    for (int u = 10; u < 90; ++u) {
      const cv::Vec2f crossing = view.crossing[0][0](v, u);
      if (crossing[0] < 0) continue;
      const double true_u = (static_cast<double>(crossing[1]) - 20) / kColumnsPerPixel;
      errors.push_back(u + static_cast<double>(crossing[0]) - true_u);
    }
  }
  ASSERT_GT(errors.size(), 1000U);
  const double unmoved = kBlur * kBlur * kGrowth;               // 0.0225 px
  EXPECT_LT(std::abs(percentile(errors, 0.5)), 0.3 * unmoved);  // to first order
}

TEST(LocalMap, InverseLeadsBackToThePixel) {
  const auto map = LocalMap::fit(decoded({}), 40, 40);
  ASSERT_TRUE(map.has_value());
  const Vec2 pixel(41.3, 39.2);
  const auto back = map->camera_from_panel(map->panel_from_camera(pixel), 3);
  ASSERT_TRUE(back.has_value());
  EXPECT_LT((*back - pixel).norm(), 1e-5);
}

TEST(ImageOrder, WrongOrdersAreNamed) {
  const std::size_t count = gray_code_sequence(kPanelWidth, kPanelHeight).size();
  std::vector<cv::Mat> drawn;
  for (std::size_t i = 0; i < count; ++i) drawn.push_back(images_of({})(i));
  const GrayImageSource right = [&](std::size_t i) { return drawn[i]; };
  const auto explanation = [&](const GrayImageSource& source) {
    const DecodedView view =
        decode_gray_stack(make_gray_stack(kPanelWidth, kPanelHeight, true, source));
    return explain_wrong_order(kPanelWidth, kPanelHeight, true, source, view);
  };
  EXPECT_EQ(explanation(right), "");
  EXPECT_EQ(explanation([&](std::size_t i) { return right(i < 2 ? i : 2 + ((i - 2) ^ 1U)); }),
            "each inverse comes before its pattern");
  EXPECT_EQ(explanation([&](std::size_t i) { return right(count - 1 - i); }),
            "the files are in reverse order");
  EXPECT_EQ(explanation([&](std::size_t i) { return right(i < 2 ? 1 - i : i); }),
            "black comes before white");
  EXPECT_THAT(explanation([&](std::size_t i) { return right(i < 1 ? i : i - 1); }),
              testing::HasSubstr("one before"));
  EXPECT_THAT(explanation([&](std::size_t i) { return right(i < 2 ? 1 : i - 2); }),
              testing::HasSubstr("two before"));
}

TEST(ImageOrder, WrongOrdersWithoutInversesAreNamed) {
  // An odd number of pictures: none has a file to change places with.
  const std::size_t count = gray_code_sequence(kPanelWidth, kPanelHeight, false).size();
  ASSERT_EQ(count % 2, 1U);
  const GrayImageSource right = images_of({.inverses = false});
  const auto explanation = [&](const auto& file) {
    const GrayImageSource source = [&](std::size_t i) {
      EXPECT_LT(file(i), count);
      return right(file(i));
    };
    const DecodedView view =
        decode_gray_stack(make_gray_stack(kPanelWidth, kPanelHeight, false, source));
    const GrayImageSource checked = [&](std::size_t i) {
      EXPECT_LT(i, count);
      return source(std::min(i, count - 1));
    };
    return explain_wrong_order(kPanelWidth, kPanelHeight, false, checked, view);
  };
  EXPECT_EQ(explanation([&](std::size_t i) { return count - 1 - i; }),
            "the files are in reverse order");
  EXPECT_EQ(explanation([](std::size_t i) { return i < 2 ? 1 - i : i; }),
            "black comes before white");
}

/// A panel of 8 column bits and 7 row bits: pictures 2 to 17 and 18 to 31.
class SwappedBits : public testing::TestWithParam<bool> {
 protected:
  /// With the bits in positions i and j of the sequence in each other's place.
  [[nodiscard]] static std::string explanation(std::size_t i, std::size_t j, double noise) {
    const bool inverses = GetParam();
    const std::size_t step = inverses ? 2 : 1;
    const GrayImageSource right = images_of({.noise = noise, .inverses = inverses});
    const GrayStack stack =
        make_gray_stack(kPanelWidth, kPanelHeight, inverses, [&](std::size_t image) {
          if (image < 2) return right(image);
          const std::size_t bit = (image - 2) / step;
          return right(2 + (bit == i ? j : bit == j ? i : bit) * step + (image - 2) % step);
        });
    return explain_swapped_bits(stack, decode_gray_stack(stack));
  }
};

TEST_P(SwappedBits, AreNamedByTheirPictures) {
  const bool inverses = GetParam();
  EXPECT_EQ(explanation(2, 3, 0.004), std::string("those of column bits 4 and 5 are exchanged ") +
                                          (inverses ? "(006, 007 and 008, 009)" : "(004 and 005)"));
  EXPECT_EQ(explanation(9, 11, 0.004),
            std::string("those of row bits 3 and 5 are exchanged ") +
                (inverses ? "(020, 021 and 024, 025)" : "(011 and 013)"));
}

TEST_P(SwappedBits, AreNotSeenInARightCapture) {
  EXPECT_EQ(explanation(0, 0, 0.004), "");
  EXPECT_EQ(explanation(0, 0, 0.03), "");
}

INSTANTIATE_TEST_SUITE_P(WithInverses, SwappedBits, testing::Bool());

/// Rows that are read as columns vary smoothly, too. Read the other way round, right ones do not.
TEST(ImageOrder, AnOrderMakesAsMuchSenseAsItIsRight) {
  const std::string rows_first = "the row bits come before the column bits";
  std::vector<cv::Mat> drawn;
  for (std::size_t i = 0; i < 32; ++i) drawn.push_back(images_of({})(i));
  const GrayImageSource right = [&](std::size_t i) { return drawn[i]; };
  const GrayImageSource wrong = [&](std::size_t i) {
    return right(i < 2 ? i : i < 16 ? i + 16 : i - 14);
  };
  const auto documented = [&](const GrayImageSource& images) {
    return sensible_share(
        decode_gray_stack(make_gray_stack(kPanelWidth, kPanelHeight, true, images)));
  };
  const auto in_order = [&](const GrayImageSource& images) {
    return sensible_share_in_order(rows_first, kPanelWidth, kPanelHeight, true, images).value();
  };
  EXPECT_GE(in_order(wrong), documented(wrong));
  EXPECT_LT(in_order(right), documented(right));
  EXPECT_FALSE(
      sensible_share_in_order("no such order", kPanelWidth, kPanelHeight, true, right).has_value());
}

/// Light on the white image alone makes all that is unlit look lit.
TEST(ImageOrder, AFlashOnTheWhiteImageIsNoWrongOrder) {
  const GrayImageSource images = images_of({});
  const GrayImageSource flashed = [&](std::size_t i) {
    cv::Mat image;  // nine tenths of it are unlit
    cv::copyMakeBorder(images(i), image, kSize, kSize, kSize, kSize, cv::BORDER_CONSTANT, 0.01);
    if (i == 0) image = cv::min(image + 0.3, 1.0);
    return image;
  };
  const DecodedView view =
      decode_gray_stack(make_gray_stack(kPanelWidth, kPanelHeight, true, flashed));
  EXPECT_EQ(explain_wrong_order(kPanelWidth, kPanelHeight, true, flashed, view), "");
}

}  // namespace
}  // namespace pencilscan
