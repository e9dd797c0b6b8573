#include "pencilscan/gray/image_order.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "pencilscan/gray/local_map.h"
#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

/// Codes make sense where they vary smoothly: shares of the lit pixels.
constexpr double kSenselessShare = 0.35;
constexpr double kSensibleShare = 0.5;

/// Rows taken for columns are smooth, too, but most panels are no squares.
bool leaves_panel(const DecodedView& view) {
  constexpr double kMuch = 0.03;  // of the lit pixels; of a right capture, next to none
  const std::size_t unlit = view.counts[static_cast<std::size_t>(PixelState::kUnlit)];
  const std::size_t off = view.counts[static_cast<std::size_t>(PixelState::kOffPanel)];
  const auto lit = std::accumulate(view.counts.begin(), view.counts.end(), std::size_t{0}) - unlit;
  return static_cast<double>(off) > kMuch * static_cast<double>(lit);
}

/// Whether white - black bounds what the bits differ by, as light adds up. Where a pattern is taken
/// for white it does not in its dark half, which then is taken for unlit.
bool white_is_brightest(const GrayStack& stack) {
  constexpr double kMost = 0.25;  // of all light: between none and half
  const cv::Mat contrast = stack.white - stack.black;
  cv::Mat most = cv::Mat::zeros(contrast.size(), CV_32FC1);
  for (const auto& bits : stack.difference)
    for (const cv::Mat& bit : bits) most = cv::max(most, cv::abs(bit));
  const cv::Mat is_brighter = 2 * contrast < most;
  return cv::sum(most).val[0] * kMost >
         cv::mean(most, is_brighter).val[0] * cv::countNonZero(is_brighter);
}

/// The file that holds image i of the sequence, in a capture of some wrong order.
struct WrongOrder {
  const char* words;
  std::size_t (*file)(std::size_t i, std::size_t count, std::size_t column_bits, std::size_t step);
};

std::size_t swap_pair(std::size_t i) { return i < 2 ? i : 2 + ((i - 2) ^ 1U); }

constexpr std::array<WrongOrder, 8> kWrongOrders{{
    {"each inverse comes before its pattern",
     [](std::size_t i, std::size_t, std::size_t, std::size_t step) {
       return step == 2 ? swap_pair(i) : i;
     }},
    {"black comes before white",
     [](std::size_t i, std::size_t, std::size_t, std::size_t) { return i < 2 ? 1 - i : i; }},
    {"black comes before white and each inverse before its pattern",
     [](std::size_t i, std::size_t, std::size_t, std::size_t step) {
       return i < 2 ? 1 - i : step == 2 ? swap_pair(i) : i;
     }},
    {"the files are in reverse order",
     [](std::size_t i, std::size_t count, std::size_t, std::size_t) { return count - 1 - i; }},
    {"each picture shows what was projected one before: the camera or the projector is late",
     [](std::size_t i, std::size_t count, std::size_t, std::size_t) {
       return std::min(i + 1, count - 1);
     }},
    {"each picture shows what was projected two before: the camera or the projector is late",
     [](std::size_t i, std::size_t count, std::size_t, std::size_t) {
       return std::min(i + 2, count - 1);
     }},
    {"the bits go from the least to the most significant",
     [](std::size_t i, std::size_t count, std::size_t column_bits, std::size_t step) {
       if (i < 2) return i;
       const std::size_t row_bits = (count - 2) / step - column_bits;
       const std::size_t bit = (i - 2) / step;
       const std::size_t part = (i - 2) % step;
       const std::size_t turned =
           bit < column_bits ? column_bits - 1 - bit : 2 * column_bits + row_bits - 1 - bit;
       return 2 + turned * step + part;
     }},
    {"the row bits come before the column bits",
     [](std::size_t i, std::size_t count, std::size_t column_bits, std::size_t step) {
       if (i < 2) return i;
       const std::size_t row_bits = (count - 2) / step - column_bits;
       const std::size_t bit = (i - 2) / step;
       return 2 + (bit < column_bits ? bit + row_bits : bit - column_bits) * step + (i - 2) % step;
     }},
}};

GrayStack stack_in_order(const WrongOrder& order, int panel_width, int panel_height, bool inverses,
                         const GrayImageSource& image) {
  const auto columns = static_cast<std::size_t>(gray_code_bits(panel_width));
  const auto rows = static_cast<std::size_t>(gray_code_bits(panel_height));
  const std::size_t step = inverses ? 2 : 1;
  const std::size_t count = 2 + step * (columns + rows);
  return make_gray_stack(panel_width, panel_height, inverses,
                         [&](std::size_t i) { return image(order.file(i, count, columns, step)); });
}

}  // namespace

double sensible_share(const DecodedView& view) { return view.valid_share() * smooth_share(view); }

std::optional<double> sensible_share_in_order(const std::string& order, int panel_width,
                                              int panel_height, bool inverses,
                                              const GrayImageSource& image,
                                              const GrayDecodeOptions& options) {
  const auto found = std::find_if(kWrongOrders.begin(), kWrongOrders.end(),
                                  [&](const WrongOrder& known) { return order == known.words; });
  if (found == kWrongOrders.end()) return std::nullopt;
  return sensible_share(decode_gray_stack(
      stack_in_order(*found, panel_width, panel_height, inverses, image), options));
}

std::string explain_wrong_order(int panel_width, int panel_height, bool inverses,
                                const GrayImageSource& image, const DecodedView& decoded,
                                const GrayDecodeOptions& options) {
  const double sensible = sensible_share(decoded);
  if (sensible > kSenselessShare && decoded.inverted_share < 0.5 && !leaves_panel(decoded))
    return {};
  std::string explanation;
  double most = std::max(kSensibleShare, sensible);
  for (const WrongOrder& order : kWrongOrders) {
    const GrayStack stack = stack_in_order(order, panel_width, panel_height, inverses, image);
    if (!white_is_brightest(stack)) continue;
    const DecodedView view = decode_gray_stack(stack, options);
    const double share = sensible_share(view);
    // Unlit pixels count against an order that takes black for white.
    if (share <= most || 2 * view.counts[0] < decoded.counts[0]) continue;
    most = share;
    explanation = order.words;
  }
  return explanation;
}

}  // namespace pencilscan
