#include "pencilscan/display/shown_check.h"

#include <opencv2/imgproc.hpp>

#include "pencilscan/core/formatted.h"

namespace pencilscan {

std::optional<ShownDifference> compare_shown(const cv::Mat& shown, const cv::Mat& expected) {
  ShownDifference result;
  result.where = {0, 0, expected.cols, expected.rows};
  if (shown.size() != expected.size() || shown.type() != expected.type()) {
    result.kind = "other";
    result.share = 1;
    result.sentence = "has " + size_text(shown.cols, shown.rows) + " px instead of " +
                      size_text(expected.cols, expected.rows);
    return result;
  }
  cv::Mat difference;
  cv::absdiff(shown, expected, difference);
  const cv::Mat flat = difference.reshape(1, difference.rows);
  cv::Mat differs;
  cv::inRange(difference, cv::Scalar::all(0), cv::Scalar::all(1), differs);
  cv::bitwise_not(differs, differs);
  const int count = cv::countNonZero(differs);
  if (count == 0) return std::nullopt;
  result.share = static_cast<double>(count) / static_cast<double>(differs.total());
  result.where = cv::boundingRect(differs);
  const bool black = cv::countNonZero(shown.reshape(1, shown.rows)) == 0;
  if (black) {
    result.kind = "black";
    result.sentence = "shows nothing but black";
    return result;
  }
  // What lies on top hides most pixels of a rectangle; a scaled or other picture differs all over.
  const double of_panel =
      static_cast<double>(result.where.area()) / static_cast<double>(differs.total());
  constexpr double kWhole = 0.98;
  result.kind = of_panel < kWhole ? "covered" : "other";
  result.sentence =
      percent_text(result.share) + " of its pixels are not what was drawn" +
      (of_panel < kWhole ? ", all within columns " + std::to_string(result.where.x) + " to " +
                               std::to_string(result.where.x + result.where.width - 1) + ", rows " +
                               std::to_string(result.where.y) + " to " +
                               std::to_string(result.where.y + result.where.height - 1)
                         : "");
  return result;
}

}  // namespace pencilscan
