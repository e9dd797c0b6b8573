#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/gray/gray_stack.h"

namespace pencilscan {

/// Why a camera pixel has no panel coordinate.
enum class PixelState : std::uint8_t {
  kValid,
  kUnlit,         ///< white - black does not stand out of the noise
  kSaturated,     ///< black reaches the end of the range: no pattern is darker
  kAmbiguous,     ///< several coarse bits lie within the noise: indirect light, or motion
  kBlurred,       ///< the fine bits lie within the noise: defocus, or a panel too fine here
  kOffPanel,      ///< the code is no column or row of the panel
  kInconsistent,  ///< its neighbours' codes say otherwise
};
inline constexpr std::size_t kPixelStates = 7;
[[nodiscard]] std::string to_string(PixelState state);

struct GrayDecodeOptions {
  double lit_deviations = 5;    ///< white - black over its own noise, > 0
  double bit_deviations = 3.5;  ///< a certain bit's difference over its noise, > 0
  double bit_contrast = 0.06;   ///< and over white - black, in [0, 1)
  int max_blurred_bits = 2;     ///< finest bits of an axis that may stay uncertain, >= 0
  double steepest_code = 4;     ///< panel px per camera px between neighbours, >= 1
  int least_support = 4;        ///< of 24 neighbours that must agree, >= 0
  int least_component_px = 24;  ///< smaller connected pieces are dropped
};

/// Panel coordinates of all pixels of one camera under one projector.
///
/// A bit is the sign of pattern - inverse (without inverses, of 2 pattern - white - black), which
/// neither ambient light nor albedo shifts. Noise is measured in the images themselves. Neighbours
/// of a Gray code differ in one bit, so one uncertain bit costs at most one panel pixel, as long as
/// the finer ones are certain. A piece of surface has codes that vary steadily: pixels without such
/// neighbours are dropped.
///
/// Between two pixels whose codes differ, the difference of the bit that changes passes through
/// zero where the panel coordinate is m + 1/2: `crossing`. Gamma and ambient light move it only to
/// second order; what blur on uneven surfaces does is taken out (gray_crossings.h). Sub-pixel
/// coordinates come from these (local_map.h).
struct DecodedView {
  cv::Mat_<std::uint8_t> state;                ///< PixelState
  std::array<cv::Mat_<std::int32_t>, 2> code;  ///< column, row; -1 where not valid
  /// [axis][direction]: between (u, v) and its right (direction 0) or lower (1) neighbour; x = how
  /// far along, in [0, 1], or < 0 for none; y = the panel coordinate there.
  std::array<std::array<cv::Mat_<cv::Vec2f>, 2>, 2> crossing;

  std::array<std::size_t, kPixelStates> counts{};  ///< pixels by state
  double noise = 0;           ///< median standard deviation of lit pixels, [0, 1] units
  double inverted_share = 0;  ///< of clearly different pixels: black brighter than white

  [[nodiscard]] bool valid(int u, int v) const {
    return state(v, u) == static_cast<std::uint8_t>(PixelState::kValid);
  }
  /// Lit pixels that were decoded.
  [[nodiscard]] double valid_share() const;
};

/// All images of the stack are CV_32FC1 and of one size, which is that of the result.
[[nodiscard]] DecodedView decode_gray_stack(const GrayStack& stack,
                                            const GrayDecodeOptions& options = {});

}  // namespace pencilscan
