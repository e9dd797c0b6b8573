#pragma once

#include <span>
#include <vector>

#include "pencilscan/guided/camera_names.h"
#include "pencilscan/guided/denied_lines.h"
#include "pencilscan/guided/name_colors.h"

namespace pencilscan {

/// Names of curves that the solution left undecided, from the lines that a camera's surface
/// predicts.
class CurveAdoption {
 public:
  CurveAdoption(const Rig& rig, const std::vector<ColorFamily>& families,
                const GuidedMatchingOptions& options, CameraNames& names)
      : colors_(rig, families), options_(options), names_(names) {}

  /// Confirms tentative labels where the predicted line is the same.
  void confirm(std::span<const LabeledRun> tentative);
  /// Gives undecided stretches of curves the predicted line they lie on.
  void adopt();
  /// Where colours denied a dense surface in the last adopt().
  [[nodiscard]] const std::vector<DeniedRun>& denied() const { return denied_; }

 private:
  [[nodiscard]] bool is_supported(const Curve& curve, const PointRange& piece, const LineName& name,
                                  float margin) const;
  [[nodiscard]] bool agrees_along(int curve, const PointRange& piece, const LineName& name) const;
  [[nodiscard]] bool is_long_enough(const std::vector<char>& decided,
                                    const PointRange& piece) const;
  void adopt_pieces(int curve, const std::vector<char>& decided, const NamedPieces& of_name,
                    std::span<const float> spacings, std::vector<LabeledRun>& adopted);

  NameColors colors_;
  const GuidedMatchingOptions& options_;
  CameraNames& names_;
  std::vector<DeniedRun> denied_;
};

}  // namespace pencilscan
