#include "pencilscan/boards/board.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

const CalibrationBoard kBoard{9, 7, 30, {}};

TEST(Board, TextSaysSquaresOfCharucoBoards) {
  const CalibrationBoard board = board_from_text("charuco:10x8:75:56.5:DICT_4X4_100", "--board");
  EXPECT_EQ(board.columns, 9);
  EXPECT_EQ(board.rows, 7);
  ASSERT_TRUE(board.markers.has_value());
  EXPECT_EQ(board.markers->side_mm, 56.5);
  EXPECT_EQ(board.markers->dictionary, "DICT_4X4_100");
}

TEST(Board, TextSaysCornersAndMillimetres) {
  const CalibrationBoard board = board_from_text("chessboard:9x7:75.5", "--board");
  EXPECT_EQ(board.columns, 9);
  EXPECT_EQ(board.rows, 7);
  EXPECT_EQ(board.square_mm, 75.5);
  for (const char* wrong :
       {"", "chessboard", "chessboard:9x7", "chessboard:9x7:0", "chessboard:2x7:5",
        "chessboard:9x7:nan", "chessboard:9x7:75mm", "charuco:9x7:75", "charuco:9x7:75:56",
        "charuco:9x7:75:76:DICT_5X5_50", "charuco:9x7:75:56:DICT_5X5_51",
        "charuco:9x7:75:56:DICT_5X5_50:1", "charuco:12x12:75:56:DICT_5X5_50"})
    EXPECT_THROW(static_cast<void>(board_from_text(wrong, "--board")), InputError) << wrong;
}

/// A board with a white margin, `cell` pixels to a square; inner corners at ((i + 2) cell - 0.5).
cv::Mat flat_board(int cell) {
  cv::Mat image((kBoard.rows + 3) * cell, (kBoard.columns + 3) * cell, CV_32F, cv::Scalar(0.8));
  for (int i = 0; i <= kBoard.columns; ++i)
    for (int j = 0; j <= kBoard.rows; ++j)
      if ((i + j) % 2 == 0) image(cv::Rect((i + 1) * cell, (j + 1) * cell, cell, cell)) = 0.1;
  return image;
}

constexpr int kSeenCell = 40;
const cv::Matx33d kView(0.9, 0.2, 60, -0.1, 0.8, 90, 2e-4, 3e-4, 1);

/// The board in perspective, blurred; cells of kSeenCell are seen by kView.
cv::Mat seen_board() {
  cv::Mat image;
  cv::warpPerspective(flat_board(kSeenCell), image, kView, {640, 480}, cv::INTER_AREA);
  cv::GaussianBlur(image, image, {}, 0.8);
  return image;
}

TEST(Board, CornersAreFoundToATenthOfAPixelUnderPerspective) {
  const std::vector<BoardCorner> corners = find_board(0.4 * seen_board(), kBoard);
  ASSERT_EQ(corners.size(), 63U);
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Vec3d x = kView * cv::Vec3d((static_cast<double>(i % 9) + 2) * kSeenCell - 0.5,
                                          (static_cast<double>(i / 9) + 2) * kSeenCell - 0.5, 1);
    const Vec2 truth(x[0] / x[2], x[1] / x[2]);
    // From either end: the board is the same upside down.
    sum += std::min((corners[i].pixel - truth).norm(), (corners[62 - i].pixel - truth).norm());
  }
  EXPECT_LT(sum / 63, 0.1);
  EXPECT_TRUE(find_board(cv::Mat(480, 640, CV_32F, cv::Scalar(0.5)), kBoard).empty());
}

/// OpenCV finds a part of it, or every other row.
TEST(Board, ALargerBoardThanStatedIsNone) {
  cv::Mat image = seen_board();
  cv::Mat noise(image.size(), CV_32F);
  cv::RNG(1).fill(noise, cv::RNG::NORMAL, 0, 0.02);
  image = 0.4 * image + noise;
  for (const cv::Size size : {cv::Size(3, 3), cv::Size(9, 4), cv::Size(7, 5), cv::Size(3, 7)}) {
    const CalibrationBoard board{size.width, size.height, 30, {}};
    BoardFinder finder(board);
    finder.look(0, 0, image);
    EXPECT_EQ(finder.found(), 0U) << size;
    EXPECT_EQ(finder.of_other_size(), 1U) << size;
  }
  BoardFinder finder(kBoard);
  finder.look(0, 0, image);
  EXPECT_EQ(finder.found(), 1U);
  EXPECT_EQ(finder.of_other_size(), 0U);
}

/// The board under Gray codes: what falls on it is weighed by black and white, then blurred.
TEST(Board, ProjectorsHaveCornersWhereCamerasFindThem) {
  constexpr int kCell = 40;
  constexpr int kPanel = 512;
  const cv::Matx33d view(0.9, 0.1, 60, -0.05, 0.85, 60, 1e-4, 1e-4, 1);
  cv::Mat board;
  cv::warpPerspective(flat_board(kCell), board, view, {640, 480}, cv::INTER_AREA);
  const auto panel_at = [](double u, double v) {
    return Vec2(30 + 0.7 * u + 0.05 * v, 40 - 0.04 * u + 0.75 * v);
  };
  const auto sequence = gray_code_sequence(kPanel, kPanel);
  const auto image = [&](std::size_t number) {
    const GrayCodeImage& shown = sequence[number];
    cv::Mat light(board.size(), CV_32F);
    for (int v = 0; v < light.rows; ++v) {
      for (int u = 0; u < light.cols; ++u) {
        const double x = panel_at(u, v)[shown.axis == Axis::kColumn ? 0 : 1];
        const int i = static_cast<int>(std::floor(x));
        const auto value = [&](int k) { return shown.bright(k) ? 1.0 : 0.0; };
        light.at<float>(v, u) = static_cast<float>((i + 1 - x) * value(i) + (x - i) * value(i + 1));
      }
    }
    cv::Mat seen = light.mul(board) + 0.02;
    cv::GaussianBlur(seen, seen, {}, 0.8);
    return seen;
  };
  const GrayStack stack = make_gray_stack(kPanel, kPanel, true, image);
  BoardFinder finder(kBoard);
  finder.look(3, 1, stack.white);
  finder.project(3, 1, 7, decode_gray_stack(stack));
  const auto corners = finder.views();
  const auto projected = finder.projected_views();
  ASSERT_EQ(corners.size(), 63U);
  ASSERT_EQ(projected.size(), 63U);
  double worst = 0;
  for (std::size_t i = 0; i < projected.size(); ++i) {
    EXPECT_EQ(projected[i].board, 3U);
    EXPECT_EQ(projected[i].view.device, 7U);
    EXPECT_EQ(projected[i].position_mm, corners[i].position_mm);
    const Vec2 pixel = corners[i].view.pixel;
    worst = std::max(worst, (projected[i].view.pixel - panel_at(pixel.x(), pixel.y())).norm());
  }
  EXPECT_LT(worst, 0.1);
}

/// On a white margin of one square, inner corners at ((column + 2) cell - 0.5).
cv::Mat with_margin(const cv::Mat& bytes, int cell) {
  cv::Mat image(bytes.rows + 2 * cell, bytes.cols + 2 * cell, CV_32F, cv::Scalar(0.8));
  cv::Mat inner = image(cv::Rect(cell, cell, bytes.cols, bytes.rows));
  bytes.convertTo(inner, CV_32F, 0.7 / 255, 0.1);
  return image;
}

/// The board as OpenCV draws it, `cell` pixels to a square.
cv::Mat flat_charuco(const CalibrationBoard& board, int cell) {
  const cv::Size squares(board.columns + 1, board.rows + 1);
  const auto drawn = cv::aruco::CharucoBoard::create(
      squares.width, squares.height, static_cast<float>(board.square_mm),
      static_cast<float>(board.markers->side_mm),
      cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100));
  cv::Mat bytes;
  drawn->draw(squares * cell, bytes);
  return with_margin(bytes, cell);
}

/// The same as OpenCV before 4.6 drew boards of an even number of rows: the first square is white.
cv::Mat older_charuco(const CalibrationBoard& board, int cell) {
  cv::Mat bytes((board.rows + 1) * cell, (board.columns + 1) * cell, CV_8U, cv::Scalar(255));
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100);
  const int side = static_cast<int>(cell * board.markers->side_mm / board.square_mm);
  int id = 0;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      cv::Mat square = bytes(cv::Rect(column * cell, row * cell, cell, cell));
      if ((column + row) % 2 == 1) {
        square = 0;
        continue;
      }
      cv::Mat marker;
      cv::aruco::drawMarker(dictionary, id++, side, marker);
      marker.copyTo(square(cv::Rect((cell - side) / 2, (cell - side) / 2, side, side)));
    }
  }
  return with_margin(bytes, cell);
}

TEST(Board, CharucoCornersAreFoundWhereOnlyPartOfTheBoardIsSeen) {
  constexpr int kCell = 60;
  enum { kOddRows, kEvenRows, kOlderEvenRows };
  for (const int kind : {kOddRows, kEvenRows, kOlderEvenRows}) {
    const int rows = kind == kOddRows ? 6 : 7;  // of corners
    const CalibrationBoard board{8, rows, 75, BoardMarkers{55, "DICT_5X5_100"}};
    const cv::Mat flat =
        kind == kOlderEvenRows ? older_charuco(board, kCell) : flat_charuco(board, kCell);
    const cv::Matx33d view(1.1, 0.3, -330, -0.15, 0.95, 60, 3e-4, 2e-4, 1);  // cuts the left off
    cv::Mat image;
    cv::warpPerspective(flat, image, view, {640, 480}, cv::INTER_AREA);
    cv::GaussianBlur(image, image, {}, 0.8);
    const std::vector<BoardCorner> corners = find_board(0.4 * image, board);
    EXPECT_GT(corners.size(), 24U);
    EXPECT_LT(corners.size(), static_cast<std::size_t>(8 * rows));
    double sum = 0;
    for (const BoardCorner& corner : corners) {
      const cv::Vec3d x =
          view * cv::Vec3d((corner.column + 2) * kCell - 0.5, (corner.row + 2) * kCell - 0.5, 1);
      sum += (corner.pixel - Vec2(x[0] / x[2], x[1] / x[2])).norm();
    }
    EXPECT_LT(sum / static_cast<double>(corners.size()), 0.1);
    // Another board has other markers.
    CalibrationBoard other = board;
    other.markers->dictionary = "DICT_6X6_100";
    EXPECT_TRUE(find_board(image, other).empty());
  }
}

}  // namespace
}  // namespace pencilscan
