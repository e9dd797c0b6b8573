#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/calibration/bundle.h"

namespace pencilscan {

/// A chessboard: inner corners along its sides, and the side of a square.
struct Chessboard {
  int columns = 0;       ///< inner corners, >= 3
  int rows = 0;          ///< inner corners, >= 3
  double square_mm = 0;  ///< > 0
};

/// Reads "chessboard:COLUMNSxROWS:SQUARE_MM"; InputError (of `field`) for anything else.
[[nodiscard]] Chessboard chessboard_from_text(const std::string& text, const std::string& field);

/// Inner corners in a grey image (CV_32FC1, [0, 1]), row by row, pixels; empty when not all of them
/// are seen. Which corner comes first is open where the board looks the same upside down.
[[nodiscard]] std::vector<Vec2> find_chessboard(const cv::Mat& image, const Chessboard& board);

/// Collects what cameras see of the board, which stands still during each capture.
class BoardFinder {
 public:
  explicit BoardFinder(const Chessboard& board) : board_(board) {}

  /// Looks for the board in a camera's image of a capture, unless it was found there before.
  void look(std::size_t capture, std::size_t camera, const cv::Mat& image);
  /// All corners; the capture is the placing of the board.
  [[nodiscard]] std::vector<BoardView> views() const;
  [[nodiscard]] std::size_t found() const { return corners_.size(); }

 private:
  Chessboard board_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<Vec2>> corners_;
};

}  // namespace pencilscan
