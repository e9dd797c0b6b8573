#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/color/color_response.h"
#include "pencilscan/color/lateral_color.h"
#include "pencilscan/gray/gray_stack.h"

namespace pencilscan {

/// What captures say of colour; devices as in the rig.
struct ColorCalibration {
  std::vector<std::optional<MeasuredNumber>> gamma;  ///< per camera
  /// By (camera, projector), where solid colours were captured.
  std::map<std::pair<std::size_t, std::size_t>, ColorResponse> responses;
  LateralColor lateral;              ///< no devices where captures are grey
  bool displaces_lines = false;      ///< enough to be written into the rig
  std::vector<std::string> remarks;  ///< in plain words: what was found, what could not be
};

/// Takes in pairs as they are decoded. Of every pair, the first capture that shows enough counts.
class ColorCollector {
 public:
  explicit ColorCollector(const Rig& rig) : rig_(rig) {}

  /// `grey`: the pair as decoded from the mean of its channels. Reads images: not for several
  /// threads at once.
  void add(const CapturePair& pair, const DecodedView& grey);
  [[nodiscard]] ColorCalibration result() const;

 private:
  struct PairColor {
    bool in_color = false;
    std::optional<MeasuredNumber> gamma;
    std::optional<ColorResponse> response;
  };
  [[nodiscard]] double gamma_of(std::size_t camera,
                                const std::optional<MeasuredNumber>& measured) const;
  void measure_channels(const CapturePair& pair, const DecodedView& grey, PairColor& color);
  void combine_gammas(ColorCalibration& result) const;
  void remark_on(ColorCalibration& result) const;

  const Rig& rig_;
  std::map<std::pair<std::size_t, std::size_t>, PairColor> pairs_;
  std::vector<ColorSample> samples_;
};

/// Writes gamma, color_matrix and color_registration where they were found; others stay.
void set_colors(const ColorCalibration& color, Rig& rig);

}  // namespace pencilscan
