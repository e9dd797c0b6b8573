#include "pencilscan/capture/picture_check.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr int kBlock = 4;  ///< px

// Blocks count as bright or dark where they are so by more than light scattered within the scene
// and a stored gamma of 2.2 would do to the other kind: a tenth of the light is stored as a third.
constexpr float kDark = 0.1F;
constexpr float kBright = 0.9F;
constexpr float kStillDark = 0.4F;
constexpr float kStillBright = 0.6F;
/// Of the blocks that are within a stripe. Edges of things that move by a pixel are fewer than the
/// blocks inside them by their size in blocks.
constexpr double kWrongShare = 0.03;
/// Blocks below which nothing can be said.
constexpr int kLeastBlocks = 60;
/// Change of white light of a block that lamps do not explain, and deviations of noise that noise
/// does not: of a million blocks one.
constexpr float kMoved = 0.15F;
constexpr float kBeyondNoise = 5;
constexpr double kMovedShare = 0.02;
constexpr double kLampChange = 0.1;

/// A change of light in units in which noise is alike in all blocks: it grows with the light's
/// root.
float in_noise(float change, float light) { return std::abs(change) / std::sqrt(light); }

}  // namespace

cv::Mat coarse_picture(const cv::Mat& image) {
  // OpenCV rounds means to the depth of the picture: a level of 8 bits is a sixth of dim light.
  cv::Mat fine;
  image.convertTo(fine, CV_16U, image.depth() == CV_8U ? 257 : 1);
  cv::Mat small;
  cv::resize(fine, small,
             cv::Size(std::max(1, image.cols / kBlock), std::max(1, image.rows / kBlock)), 0, 0,
             cv::INTER_AREA);
  if (small.channels() == 3) cv::transform(small, small, cv::Matx13f(1.F / 3, 1.F / 3, 1.F / 3));
  cv::Mat result;
  small.convertTo(result, CV_32F, 1.0 / 65535);
  return result;
}

LitView lit_view(const cv::Mat& white, const cv::Mat& black) {
  LitView view;
  view.black = black;
  view.light = white - black;
  std::vector<float> values(view.light.begin<float>(), view.light.end<float>());
  // Half a level of 8 bits is what a block's mean may be off by noise; light that is a tenth of the
  // brightest is within what other surfaces scatter.
  const double brightest = lower_quantile(values, 0.98);
  const double least = std::max(0.02, 0.1 * brightest);
  view.lit = view.light > least;
  const int count = cv::countNonZero(view.lit);
  view.share = static_cast<double>(count) / static_cast<double>(view.lit.total());
  if (count == 0) return view;
  values.clear();
  int full = 0;
  for (int y = 0; y < view.lit.rows; ++y) {
    for (int x = 0; x < view.lit.cols; ++x) {
      if (view.lit.at<std::uint8_t>(y, x) == 0) continue;
      values.push_back(view.light.at<float>(y, x));
      if (white.at<float>(y, x) > 0.99F) ++full;
    }
  }
  view.brightest = lower_quantile(values, 0.95);
  view.saturated = static_cast<double>(full) / count;
  return view;
}

std::string pair_trouble(const cv::Mat& pattern, const cv::Mat& inverse, const LitView& view) {
  int within = 0;
  int wrong = 0;
  for (int y = 0; y < view.lit.rows; ++y) {
    for (int x = 0; x < view.lit.cols; ++x) {
      if (view.lit.at<std::uint8_t>(y, x) == 0) continue;
      const float light = view.light.at<float>(y, x);
      const float black = view.black.at<float>(y, x);
      const float a = (pattern.at<float>(y, x) - black) / light;
      const float b = (inverse.at<float>(y, x) - black) / light;
      const bool bright = a > kBright || b > kBright;
      const bool dark = a < kDark || b < kDark;
      if (!bright && !dark) continue;
      ++within;
      const bool both_bright = bright && std::min(a, b) > kStillDark;
      const bool both_dark = dark && std::max(a, b) < kStillBright;
      if (both_bright || both_dark) ++wrong;
    }
  }
  if (within < kLeastBlocks) return {};
  const double share = static_cast<double>(wrong) / within;
  if (share <= kWrongShare) return {};
  return percent_text(share) +
         " of what it lights is alike in a pattern and its inverse: one of them came late, or "
         "something moved";
}

WhiteTrouble white_again_trouble(const cv::Mat& white, const cv::Mat& again, const LitView& view) {
  struct Block {
    float light;
    float change;
  };
  std::vector<Block> blocks;
  std::vector<float> ratios;
  for (int y = 0; y < view.lit.rows; ++y) {
    for (int x = 0; x < view.lit.cols; ++x) {
      if (view.lit.at<std::uint8_t>(y, x) == 0) continue;
      blocks.push_back({view.light.at<float>(y, x), again.at<float>(y, x) - white.at<float>(y, x)});
      ratios.push_back(blocks.back().change / blocks.back().light);
    }
  }
  if (static_cast<int>(blocks.size()) < kLeastBlocks) return {};
  const float lamp = upper_median(ratios);
  if (std::abs(lamp) > kLampChange)
    return {"the projector's white changed by " + percent_text(lamp) +
            " during the capture: its lamp warms up, or an automatic exposure is on"};
  std::vector<float> changes;
  for (Block& block : blocks) {
    block.change -= lamp * block.light;
    changes.push_back(in_noise(block.change, block.light));
  }
  // However much moved: noise alone is what the quarter of the blocks shows that changed least.
  const float noise =
      lower_quantile(changes, 0.25) / static_cast<float>(kLowerQuartilePerDeviation);
  const auto moved = std::count_if(blocks.begin(), blocks.end(), [&](const Block& block) {
    return std::abs(block.change) > kMoved * block.light &&
           in_noise(block.change, block.light) > kBeyondNoise * noise;
  });
  const double share = static_cast<double>(moved) / static_cast<double>(blocks.size());
  if (share <= kMovedShare) return {};
  return {
      percent_text(share) +
          " of what is lit changed from the first to the last picture: the object or the camera "
          "moved",
      true};
}

}  // namespace pencilscan
