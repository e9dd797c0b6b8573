#include "pencilscan/calibration/board.h"

#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"

namespace pencilscan {

Chessboard chessboard_from_text(const std::string& text, const std::string& field) {
  Chessboard board;
  int used = 0;
  const int fields = std::sscanf(text.c_str(), "chessboard:%dx%d:%lf%n", &board.columns,
                                 &board.rows, &board.square_mm, &used);
  constexpr int kFewest = 3;
  constexpr int kMost = 100;
  if (fields != 3 || static_cast<std::size_t>(used) != text.size() || board.columns < kFewest ||
      board.rows < kFewest || board.columns > kMost || board.rows > kMost ||
      !(board.square_mm > 0) || !std::isfinite(board.square_mm))
    throw InputError("command line", field, text,
                     "must be chessboard:COLUMNSxROWS:MM, inner corners (3 to 100) and the side of "
                     "a square > 0, as chessboard:9x7:75");
  return board;
}

std::vector<Vec2> find_chessboard(const cv::Mat& image, const Chessboard& board) {
  // A projector lights part of the scene only: the brightest hundredth must not set the range.
  cv::Mat sorted;
  cv::sort(image.reshape(1, 1), sorted, cv::SORT_EVERY_ROW | cv::SORT_ASCENDING);
  const float bright = sorted.at<float>(0, static_cast<int>(0.99 * (sorted.cols - 1)));
  if (!(bright > 0)) return {};
  cv::Mat bytes;
  image.convertTo(bytes, CV_8U, 255.0 / bright);
  const cv::Size size(board.columns, board.rows);
  std::vector<cv::Point2f> corners;
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY;
  if (!cv::findChessboardCornersSB(bytes, size, corners, flags)) {
    if (!cv::findChessboardCorners(
            bytes, size, corners,
            cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK))
      return {};
    constexpr int kHalfWindow = 5;
    cv::cornerSubPix(bytes, corners, {kHalfWindow, kHalfWindow}, {-1, -1},
                     {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 50, 1e-3});
  }
  std::vector<Vec2> result;
  for (const cv::Point2f& corner : corners) result.emplace_back(corner.x, corner.y);
  return result;
}

void BoardFinder::look(std::size_t capture, std::size_t camera, const cv::Mat& image) {
  const std::pair key(capture, camera);
  if (corners_.count(key) > 0) return;
  std::vector<Vec2> corners = find_chessboard(image, board_);
  if (!corners.empty()) corners_.emplace(key, std::move(corners));
}

std::vector<BoardView> BoardFinder::views() const {
  constexpr double kCornerSigmaPx = 0.1;
  std::vector<BoardView> views;
  for (const auto& [key, corners] : corners_) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const auto columns = static_cast<std::size_t>(board_.columns);
      const Vec2 position(static_cast<double>(i % columns), static_cast<double>(i / columns));
      views.push_back(
          {key.first, board_.square_mm * position, {key.second, corners[i], kCornerSigmaPx}});
    }
  }
  return views;
}

}  // namespace pencilscan
