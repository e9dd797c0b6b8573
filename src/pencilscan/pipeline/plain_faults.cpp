#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "pencilscan/core/median.h"
#include "pencilscan/detection/mosaic_trace.h"
#include "pencilscan/pipeline/picture_check.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// Light of a picture in blocks of 8 x 8 px is above its noise by less than this many deviations:
/// of 20,000 blocks of noise alone, the largest lies 4 above the median.
constexpr double kBlackDeviations = 6;

/// Every eighth row, which tells as much of what a whole picture is; shares the pixels.
cv::Mat some_rows(const cv::Mat& picture) {
  return {picture.rows / 8, picture.cols, picture.type(), picture.data, 8 * picture.step};
}

/// Mean absolute difference of neighbours in a row, as a deviation of one pixel (Gaussian noise:
/// E|d| = 2 sigma / sqrt(pi)). Lines raise it, which only makes the rule for black stricter.
double pixel_noise(const cv::Mat& grey) {
  const cv::Mat left = grey.colRange(0, grey.cols - 2);
  const cv::Mat right = grey.colRange(2, grey.cols);  // the same colour of a mosaic
  return cv::norm(left, right, cv::NORM_L1) / static_cast<double>(left.total()) * std::sqrt(M_PI) /
         2;
}

bool is_black(const cv::Mat& picture) {
  constexpr int kBlock = 8;
  if (picture.cols < 4 * kBlock || picture.rows < 4 * kBlock) return false;
  const auto grey = [](const cv::Mat& rgb) {
    cv::Mat sum = rgb;
    if (rgb.channels() == 3) cv::transform(rgb, sum, cv::Matx13f(1, 1, 1));
    return sum;
  };
  cv::Mat blocks;
  cv::resize(picture, blocks, {picture.cols / kBlock, picture.rows / kBlock}, 0, 0, cv::INTER_AREA);
  blocks = grey(blocks);
  std::vector<float> values(blocks.begin<float>(), blocks.end<float>());
  const float brightest = *std::max_element(values.begin(), values.end());
  const float usual = upper_median(std::move(values));
  return static_cast<double>(brightest - usual) <=
         kBlackDeviations * pixel_noise(grey(some_rows(picture))) / kBlock;
}

bool needs_color(const Rig& rig) {
  const std::vector<ColorFamily> families = color_families(rig);
  return families.size() > 1 || (families.size() == 1 && families[0].colors.size() > 1);
}

bool is_grey(const cv::Mat& picture) {
  if (picture.channels() != 3) return false;
  constexpr float kStep = 2.5F / 255;  // JPEG's rounding of its colour differences
  constexpr float kFaint = 0.05F;      // of the brightest: colours of a dark picture are small
  const cv::Mat rows = some_rows(picture);
  std::vector<cv::Mat> rgb;
  cv::split(rows, rgb);
  double brightest = 0;
  cv::minMaxLoc(rgb[1], nullptr, &brightest);
  const double step = std::min(kStep, kFaint * static_cast<float>(brightest));
  const cv::Mat colorful = (cv::abs(rgb[0] - rgb[1]) > step) | (cv::abs(rgb[2] - rgb[1]) > step);
  constexpr int kFew = 1000;  // one pixel in so many
  return !are_more_than_one_in(kFew, colorful);
}

bool is_same(const cv::Mat& a, const cv::Mat& b) {
  const auto equal = [](const cv::Mat& x, const cv::Mat& y) {
    return cv::norm(x, y, cv::NORM_INF) == 0;
  };
  return a.size() == b.size() && a.type() == b.type() &&
         equal(a.row(a.rows / 2), b.row(b.rows / 2)) && equal(a, b);
}

}  // namespace

std::vector<PictureFinding> plain_faults(const Rig& rig, const Frame& frame) {
  std::vector<PictureFinding> findings;
  const bool colored = needs_color(rig);
  std::vector<char> faulty(rig.cameras.size(), 0);
  const auto find = [&](PictureFault fault, std::size_t c, int other = -1) {
    faulty[c] = 1;
    findings.push_back({fault, static_cast<int>(c), other});
  };
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const cv::Mat& stored = frame.images[c];
    if (stored.empty() || rig.cameras[c].sees_texture_only) continue;
    const cv::Mat picture = camera_values(rig.cameras[c], stored);
    if (is_black(picture)) {
      find(PictureFault::kBlack, c);
      continue;
    }
    const std::optional<Mosaic>& stated = rig.cameras[c].mosaic;
    const Greens greens = stored.channels() == 1 ? greens_of(stored) : Greens::kNone;
    if (stated && greens != Greens::kNone && greens != greens_of(*stated)) {
      find(PictureFault::kOtherMosaic, c);
      findings.back().greens = greens;
      continue;
    }
    if (colored && is_grey(picture)) {
      find(greens == Greens::kNone ? PictureFault::kGrey : PictureFault::kUnstatedMosaic, c);
      findings.back().greens = greens;
      continue;
    }
    // A copy of a picture says nothing of which camera took it: both are left out.
    for (std::size_t other = 0; other < c; ++other) {
      if (frame.images[other].empty() || !is_same(stored, frame.images[other])) continue;
      if (!faulty[other]) find(PictureFault::kRepeated, other, static_cast<int>(c));
      find(PictureFault::kRepeated, c, static_cast<int>(other));
      break;
    }
  }
  return findings;
}

}  // namespace pencilscan
