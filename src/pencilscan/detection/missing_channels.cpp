#include "pencilscan/detection/missing_channels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "pencilscan/pattern/color_likeness.h"

namespace pencilscan {
namespace {

/// Standard deviation of the window that lines around are seen through, in line spacings. It then
/// holds five lines of a pattern: a code of two symbols and order 3 has at most three of one symbol
/// in a row, of order 4 four.
constexpr double kCodeWindow = 2;

/// Where in one picture colour `full` of a family looks like its colour `rest`.
class MissingChannels {
 public:
  MissingChannels(cv::Size size, double spacing_px, std::size_t full, std::size_t rest,
                  std::size_t colors)
      : spacing_px_(static_cast<float>(spacing_px)),
        full_(full),
        rest_(rest),
        colors_(colors),
        lines_(static_cast<int>(std::ceil(size.height / spacing_px)) + 1,
               static_cast<int>(std::ceil(size.width / spacing_px)) + 1, CV_32F, cv::Scalar(0)),
        evidence_(lines_.clone()) {}

  /// What the lines along a curve say: the logarithm of how much likelier its colours are where
  /// nothing is missing, half of the lines being of each colour, than where it is.
  void add(const Curve& curve) {
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      const float* row = curve.code.data() + i * colors_;
      const float ratio = std::log(0.5F + 0.5F * std::exp(row[full_] - row[rest_]));
      // Points are a pixel apart.
      const cv::Point cell = cell_of(curve.points[i]);
      lines_.at<float>(cell) += 1 / spacing_px_;
      evidence_.at<float>(cell) += ratio / spacing_px_;
    }
  }

  /// Weighs what lies around each place.
  void spread() {
    // A line through a window's middle counts once.
    const double scale = kCodeWindow * std::sqrt(2 * std::numbers::pi);
    cv::GaussianBlur(evidence_, evidence_, {}, kCodeWindow, kCodeWindow, cv::BORDER_CONSTANT);
    evidence_ *= scale;
    constexpr int kTurns = 10;
    double total = 0;
    for (int turn = 0; turn < kTurns; ++turn) {
      double missing = 0;
      total = 0;
      for (int y = 0; y < lines_.rows; ++y) {
        for (int x = 0; x < lines_.cols; ++x) {
          const double lines = lines_.at<float>(y, x);
          missing += lines * probability(evidence_.at<float>(y, x));
          total += lines;
        }
      }
      if (!(total > 0)) return;
      share_ = std::clamp(missing / total, kLeastShare, 1 - kLeastShare);
    }
  }

  void apply(Curve& curve) const {
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
      float* row = curve.code.data() + i * colors_;
      if (!(row[rest_] > row[full_])) continue;
      const auto p = static_cast<float>(probability(evidence_.at<float>(cell_of(curve.points[i]))));
      row[full_] = row[rest_] + std::log((1 - p) * std::exp(row[full_] - row[rest_]) + p);
    }
  }

 private:
  static constexpr double kLeastShare = 1e-3;  ///< of places: none of a few hundred cells

  [[nodiscard]] cv::Point cell_of(const CurvePoint& point) const {
    const auto cell = [&](float position, int cells) {
      return std::clamp(static_cast<int>(position / spacing_px_), 0, cells - 1);
    };
    return {cell(point.position.x(), lines_.cols), cell(point.position.y(), lines_.rows)};
  }
  /// That the channels are missing where lines around have this evidence.
  [[nodiscard]] double probability(float evidence) const {
    return share_ / (share_ + (1 - share_) * std::exp(static_cast<double>(evidence)));
  }

  float spacing_px_;
  std::size_t full_;
  std::size_t rest_;
  std::size_t colors_;
  cv::Mat lines_;       ///< per cell of a spacing, spacings of curve
  cv::Mat evidence_;    ///< the same, weighed; then around each cell
  double share_ = 0.1;  ///< of places that lack the channels; where the turns begin
};

}  // namespace

void allow_for_missing_channels(const std::vector<ColorFamily>& families, cv::Size size,
                                double spacing_px, std::vector<Curve>& curves) {
  spacing_px = std::max(1.0, spacing_px);  // lines closer than pixels are none
  for (std::size_t f = 0; f < families.size(); ++f) {
    const std::vector<PatternColor>& colors = families[f].colors;
    for (std::size_t full = 0; full < colors.size(); ++full) {
      for (std::size_t rest = 0; rest < colors.size(); ++rest) {
        if (!is_rest_of(colors[rest], colors[full])) continue;
        MissingChannels missing(size, spacing_px, full, rest, colors.size());
        for (const Curve& curve : curves)
          if (curve.family == static_cast<int>(f)) missing.add(curve);
        missing.spread();
        for (Curve& curve : curves)
          if (curve.family == static_cast<int>(f)) missing.apply(curve);
      }
    }
  }
}

}  // namespace pencilscan
