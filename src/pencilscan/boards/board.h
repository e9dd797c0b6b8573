#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/bundle/bundle.h"
#include "pencilscan/gray/gray_decode.h"

namespace pencilscan {

/// What a ChArUco board shows in its white squares.
struct BoardMarkers {
  double side_mm = 0;      ///< of a marker, > 0, below that of a square
  std::string dictionary;  ///< OpenCV's name, as DICT_5X5_100
};

/// A chessboard, or with markers a ChArUco board.
struct CalibrationBoard {
  int columns = 0;       ///< inner corners along a side, >= 3
  int rows = 0;          ///< inner corners, >= 3
  double square_mm = 0;  ///< side of a square, > 0
  std::optional<BoardMarkers> markers;
};

/// An inner corner where an image shows it.
struct BoardCorner {
  int column = 0;
  int row = 0;
  Vec2 pixel = Vec2::Zero();
};

/// Reads "chessboard:COLUMNSxROWS:SQUARE_MM" (inner corners) or
/// "charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM:DICTIONARY" (squares, as OpenCV counts the two);
/// InputError (of `field`) for anything else.
[[nodiscard]] CalibrationBoard board_from_text(const std::string& text, const std::string& field);

/// Inner corners in a grey image (CV_32FC1, [0, 1]), row by row. Of a chessboard all or none; which
/// corner comes first is open where it looks the same upside down. Of a ChArUco board those beside
/// markers that were read, eight or more in two rows and columns; none otherwise.
[[nodiscard]] std::vector<BoardCorner> find_board(const cv::Mat& image,
                                                  const CalibrationBoard& board);

/// True where the corners that were found of a chessboard are all that it has: one square lies
/// between neighbours, and no further row of squares beyond those of the border. OpenCV also finds
/// a part of a larger board, or every other row.
[[nodiscard]] bool are_all_corners(const std::vector<BoardCorner>& corners, const cv::Mat& image,
                                   const CalibrationBoard& board);

/// Corners of a ChArUco board, in an image of bytes. Markers may stand as boards since OpenCV 4.6
/// have them, or as older ones with an even number of rows: what fits is taken.
[[nodiscard]] std::vector<BoardCorner> find_charuco(const cv::Mat& bytes,
                                                    const CalibrationBoard& board);

/// Collects what cameras see of the board, which stands still during each capture.
class BoardFinder {
 public:
  explicit BoardFinder(CalibrationBoard board) : board_(std::move(board)) {}

  /// Looks for the board in a camera's image of a capture, unless all of it was found before. A
  /// board of another size is none.
  void look(std::size_t capture, std::size_t camera, const cv::Mat& image);
  /// Where a projector (a device of the rig) has the corners that a camera found in a capture:
  /// the panel coordinates at the corners' pixels (D. Moreno, G. Taubin, "Simple, accurate, and
  /// robust projector-camera calibration", 3DIMPVT 2012). The camera that sees most of them counts.
  void project(std::size_t capture, std::size_t camera, std::size_t projector,
               const DecodedView& decoded);
  /// All corners that cameras found; the capture is the placing of the board.
  [[nodiscard]] std::vector<BoardView> views() const { return views_of(corners_); }
  /// The same of projectors.
  [[nodiscard]] std::vector<BoardView> projected_views() const { return views_of(projected_); }
  [[nodiscard]] std::size_t found() const { return corners_.size(); }
  /// Images that show a board of another size.
  [[nodiscard]] std::size_t of_other_size() const { return of_other_size_; }

 private:
  using Corners = std::map<std::pair<std::size_t, std::size_t>, std::vector<BoardCorner>>;
  [[nodiscard]] std::vector<BoardView> views_of(const Corners& corners) const;

  CalibrationBoard board_;
  std::size_t of_other_size_ = 0;
  Corners corners_;    ///< by capture and camera
  Corners projected_;  ///< by capture and projector
};

}  // namespace pencilscan
