#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "pencilscan/guided/camera_names.h"
#include "pencilscan/guided/name_colors.h"
#include "pencilscan/guided/named_ends.h"

namespace pencilscan {

/// Curves of predicted lines that detection did not find, from what the known curves leave of a
/// camera's presence images.
class LineSearch {
 public:
  /// `presence`: per family; without images only name_shared() finds something.
  LineSearch(const Rig& rig, const std::vector<ColorFamily>& families,
             std::vector<cv::Mat> presence, const GuidedMatchingOptions& options,
             CameraNames& names);

  /// Fits what is still missing to what the known curves leave.
  void find_missing();
  /// Fits it beside named curves, which hold its light too.
  void find_merged();
  /// Names lines that lie on curves of other projectors, where the light is that of all.
  void name_shared();

 private:
  /// A point of a curve.
  struct CurvePlace {
    std::size_t curve;
    std::size_t point;
  };
  struct News {
    std::vector<Curve> curves;
    std::vector<LabeledRun> runs;
  };
  void add_good(Curve curve, const std::vector<char>& good, const LineName& name, News& news) const;
  template <class IsLine>
  void add_new(const Curve& curve, const ContinuedLine& line, IsLine is_line, const LineName& name,
               News& news) const;
  void append(News news, bool hold_light);
  [[nodiscard]] Curve guess_of(const LineChain& chain) const;
  [[nodiscard]] Places<CurvePlace> undecided_places() const;
  [[nodiscard]] bool is_of_other(const CurvePlace& place, const LineName& name) const;
  [[nodiscard]] bool is_rest_of_other(const CurvePoint& point, const LineName& name, float reach,
                                      const Places<CurvePlace>& undecided) const;

  const std::vector<ColorFamily>& families_;
  NameColors colors_;
  const GuidedMatchingOptions& options_;
  CameraNames& names_;
  std::vector<cv::Mat> unexplained_;  ///< per family; empty without images
  std::vector<char> is_subtracted_;   ///< per curve, from them
};

}  // namespace pencilscan
