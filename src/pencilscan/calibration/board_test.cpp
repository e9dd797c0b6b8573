#include "pencilscan/calibration/board.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/calibration/board_start.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"

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

TEST(Board, CornersAreFoundToATenthOfAPixelUnderPerspective) {
  constexpr int kCell = 40;
  const cv::Matx33d view(0.9, 0.2, 60, -0.1, 0.8, 90, 2e-4, 3e-4, 1);
  cv::Mat image;
  cv::warpPerspective(flat_board(kCell), image, view, {640, 480}, cv::INTER_AREA);
  cv::GaussianBlur(image, image, {}, 0.8);
  const std::vector<BoardCorner> corners = find_board(0.4 * image, kBoard);
  ASSERT_EQ(corners.size(), 63U);
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Vec3d x = view * cv::Vec3d((static_cast<double>(i % 9) + 2) * kCell - 0.5,
                                         (static_cast<double>(i / 9) + 2) * kCell - 0.5, 1);
    const Vec2 truth(x[0] / x[2], x[1] / x[2]);
    // From either end: the board is the same upside down.
    sum += std::min((corners[i].pixel - truth).norm(), (corners[62 - i].pixel - truth).norm());
  }
  EXPECT_LT(sum / 63, 0.1);
  EXPECT_TRUE(find_board(cv::Mat(480, 640, CV_32F, cv::Scalar(0.5)), kBoard).empty());
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

/// A camera and a projector before a tilted board that fills both.
class OnBoard : public testing::Test {
 protected:
  OnBoard() {
    truth_.cameras = {sample::device_at<Camera>({900, -250, 120}, "cam0", 1280, 960, 1500)};
    truth_.projectors = {sample::device_at<Projector>({800, 300, -80}, "proj0", 1024, 768, 1300)};
    truth_.projectors[0].K(1, 2) = 620;  // lens shift
  }

  /// World from board: the board's middle lies in the origin.
  static RigidTransform placing(double tilt_y, double tilt_z) {
    Mat3 R;
    R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    R = Eigen::AngleAxisd(tilt_z, Vec3::UnitZ()) * Eigen::AngleAxisd(tilt_y, Vec3::UnitY()) * R;
    const Vec3 middle(4 * kBoard.square_mm, 3 * kBoard.square_mm, 0);
    return {R, -(R * middle)};
  }

  /// Adds a capture: corners in all cameras, tracks on the board's plane. The board may be bent:
  /// its ends stand `bend_mm` off the plane.
  void add_capture(const RigidTransform& world_from_board, double bend_mm = 0) {
    const std::size_t capture = input_.boards++;
    for (std::size_t c = 0; c < truth_.cameras.size(); ++c)
      for (int i = 0; i < kBoard.columns * kBoard.rows; ++i) {
        // The second camera numbers the corners from the other end.
        const int k = c == 0 ? i : kBoard.columns * kBoard.rows - 1 - i;
        const Vec2 at = kBoard.square_mm * Vec2(k % kBoard.columns, k / kBoard.columns);
        const Vec2 shown = kBoard.square_mm * Vec2(i % kBoard.columns, i / kBoard.columns);
        const double along = at.x() / (4 * kBoard.square_mm) - 1;
        const Vec3 x = world_from_board * Vec3(at.x(), at.y(), bend_mm * along * along);
        input_.board_views.push_back(
            {capture, shown, {c, *truth_.cameras[c].project(x) + noise(0.1), 0.1}});
      }
    for (int i = 0; i < 250; ++i)
      add_track(world_from_board * Vec3(random_.uniform(0, 240), random_.uniform(0, 180), 0),
                capture);
  }

  void add_track(const Vec3& x, std::size_t capture) {
    Track track;
    track.capture = capture;
    const auto hub = truth_.projectors[0].project(x);
    if (!hub || !truth_.projectors[0].contains(*hub)) return;
    track.views.push_back({truth_.cameras.size(), *hub, 0.02});
    for (std::size_t c = 0; c < truth_.cameras.size(); ++c) {
      const auto pixel = truth_.cameras[c].project(x);
      if (pixel && truth_.cameras[c].contains(*pixel))
        track.views.push_back({c, *pixel + noise(0.1), 0.1});
    }
    if (track.views.size() > 1) input_.tracks.push_back(track);
  }

  CalibrationResult calibrated() {
    input_.rig = truth_;
    input_.known.assign(device_count(truth_), {});
    for (std::size_t d = 0; d < input_.known.size(); ++d) {
      Device& device = device_at(input_.rig, d);
      device.K = Mat3::Identity();
      device.device_from_world = {};
    }
    return calibrate(input_);
  }

  Vec2 noise(double sigma) { return {random_.normal(0, sigma), random_.normal(0, sigma)}; }

  [[nodiscard]] static double distance(const Rig& rig) {
    return (rig.cameras[0].center() - rig.projectors[0].center()).norm();
  }

  Rig truth_;
  CalibrationInput input_;
  Random random_{5};
};

TEST_F(OnBoard, OnePoseGivesTheCameraAndNeverAGoodRig) {
  add_capture(placing(0.5, -0.5));
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  EXPECT_TRUE(result.rig.unit_known);
  EXPECT_LT(result.rms_px, 0.2);         // of 0.1 px noise in each coordinate
  EXPECT_LT(result.board_rms_px, 0.25);  // the same, less what the pose takes up
  const Uncertainty sigma = uncertainty(result.problem, result.free_inner,
                                        BundleOptions{}.loss_scale, result.extra_sigma_px);
  EXPECT_LT(std::abs(result.rig.cameras[0].K(0, 0) - truth_.cameras[0].K(0, 0)),
            3 * sigma.devices[0].inner[kFx]);
  EXPECT_NE(judge(input_, result, sigma, {}).grade, Grade::kGood);
}

TEST_F(OnBoard, ABentBoardErrsWithinItsDeviations) {
  constexpr double kBendMm = 0.25;  // of a diagonal of 300 mm: a little less than a thousandth
  add_capture(placing(0.5, -0.5), kBendMm);
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  const Uncertainty sigma = uncertainty(result.problem, result.free_inner,
                                        BundleOptions{}.loss_scale, result.extra_sigma_px);
  for (const auto& [i, truth] : {std::pair(kFx, 1500.0), std::pair(kCx, 640.0)})
    EXPECT_LT(std::abs(result.problem.devices[0].inner[i] - truth), 3 * sigma.devices[0].inner[i]);
  // Corners good to a tenth of a pixel would say 0.2 % if the board were flat.
  EXPECT_GT(sigma.devices[0].inner[kFx], 0.003 * 1500);
}

TEST_F(OnBoard, ABoardThatTheProjectorSeesTooTiesItToTheCamera) {
  const RigidTransform board = placing(0.5, -0.5);
  add_capture(board);
  for (int i = 0; i < 500; ++i)  // a wall 100 mm behind the board
    add_track(board * Vec3(random_.uniform(-100, 340), random_.uniform(-100, 280), -100), 0);
  const auto judged = [&] {
    const CalibrationResult result = calibrated();
    EXPECT_TRUE(result.solved);
    const Uncertainty sigma = uncertainty(result.problem, result.free_inner,
                                          BundleOptions{}.loss_scale, result.extra_sigma_px);
    return std::pair(result, sigma);
  };
  const Uncertainty without = judged().second;
  for (int i = kBoard.columns * kBoard.rows; i-- > 0;) {
    const Vec2 at = kBoard.square_mm * Vec2(i % kBoard.columns, i / kBoard.columns);
    const int k = kBoard.columns * kBoard.rows - 1 - i;  // numbered from the other end
    const Vec2 shown = kBoard.square_mm * Vec2(k % kBoard.columns, k / kBoard.columns);
    const Vec3 x = board * Vec3(at.x(), at.y(), 0);
    input_.projected_corners.push_back(
        {0, shown, {1, *truth_.projectors[0].project(x) + noise(0.1), 0.1}});
  }
  const auto [result, sigma] = judged();
  EXPECT_EQ(result.problem.board_views.size(), 126U);
  EXPECT_LT(result.board_rms_px, 0.25);
  EXPECT_NEAR(distance(result.rig) / distance(truth_), 1, 0.05);  // hangs on the focal lengths
  EXPECT_LT(std::abs(result.rig.projectors[0].K(0, 0) - 1300), 3 * sigma.devices[1].inner[kFx]);
  EXPECT_LT(sigma.volume_median, 0.7 * without.volume_median);
}

TEST_F(OnBoard, FivePosesGiveFocalLengthsAndScale) {
  for (const auto& [y, z] : {std::pair(0.5, 0.3), std::pair(-0.4, 0.4), std::pair(0.2, -0.6),
                             std::pair(-0.5, -0.3), std::pair(0.0, 0.1)})
    add_capture(placing(y, z));
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  EXPECT_NEAR(result.rig.cameras[0].K(0, 0), 1500, 6);
  EXPECT_NEAR(result.rig.projectors[0].K(0, 0), 1300, 8);
  EXPECT_NEAR(result.rig.projectors[0].K(1, 2), 620, 15);
  EXPECT_NEAR(distance(result.rig) / distance(truth_), 1, 0.02);  // hangs on the focal lengths
}

TEST_F(OnBoard, ABoardInASceneWithDepthGivesItsScaleFromEitherEnd) {
  truth_.cameras.push_back(sample::device_at<Camera>({850, 80, 350}, "cam1", 1280, 960, 1600));
  add_capture(placing(0.4, 0.2));
  for (int i = 0; i < 800; ++i)
    add_track(
        Vec3(random_.uniform(-150, 150), random_.uniform(-150, 150), random_.uniform(-120, 120)),
        0);
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  EXPECT_TRUE(result.rig.unit_known);
  EXPECT_LT(result.board_rms_px, 0.25);
  EXPECT_NEAR(distance(result.rig) / distance(truth_), 1, 0.02);  // hangs on the focal lengths
}

}  // namespace
}  // namespace pencilscan
