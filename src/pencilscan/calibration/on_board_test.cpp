#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/boards/board.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/priors.h"
#include "pencilscan/calibration/board_start.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/core/random.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

const CalibrationBoard kPlate{9, 7, 30, {}};

/// A camera and a projector before a tilted board that fills both.
class OnBoard : public testing::Test {
 protected:
  OnBoard() {
    shared_.fill(Vec2::Zero());
    truth_.cameras = {sample::device_at<Camera>({900, -250, 120}, "cam0", 1280, 960, 1500)};
    truth_.projectors = {sample::device_at<Projector>({800, 300, -80}, "proj0", 1024, 768, 1300)};
    truth_.projectors[0].K(1, 2) = 620;  // lens shift
  }

  /// World from board: the board's middle lies in the origin.
  static RigidTransform placing(double tilt_y, double tilt_z) {
    Mat3 R;
    R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    R = Eigen::AngleAxisd(tilt_z, Vec3::UnitZ()) * Eigen::AngleAxisd(tilt_y, Vec3::UnitY()) * R;
    const Vec3 middle(4 * kPlate.square_mm, 3 * kPlate.square_mm, 0);
    return {R, -(R * middle)};
  }

  /// Adds a capture: corners in all cameras, tracks on the board's plane. The board may be bent:
  /// its ends stand `bend_mm` off the plane.
  void add_capture(const RigidTransform& world_from_board, double bend_mm = 0) {
    const std::size_t capture = input_.boards++;
    for (std::size_t c = 0; c < truth_.cameras.size(); ++c)
      for (int i = 0; i < kPlate.columns * kPlate.rows; ++i) {
        // The second camera numbers the corners from the other end.
        const int k = c == 0 ? i : kPlate.columns * kPlate.rows - 1 - i;
        const Vec2 at = kPlate.square_mm * Vec2(k % kPlate.columns, k / kPlate.columns);
        const Vec2 shown = kPlate.square_mm * Vec2(i % kPlate.columns, i / kPlate.columns);
        const double along = at.x() / (4 * kPlate.square_mm) - 1;
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
        track.views.push_back(
            {c, *pixel + noise(track_noise_px_) + shared_[ninth_of(*pixel)], track_noise_px_});
    }
    if (track.views.size() > 1) input_.tracks.push_back(track);
  }

  CalibrationResult calibrated() {
    input_.rig = truth_;
    input_.known.assign(device_count(truth_), {});
    for (std::size_t d = 0; d < input_.known.size(); ++d) {
      Device& device = device_at(input_.rig, d);
      device.K = Mat3::Identity();
      device.distortion = {};
      device.device_from_world = {};
    }
    return calibrate(input_);
  }

  /// The board's corners as the projector shows them, numbered from the other end; the first ones
  /// are not decoded.
  void add_projected_corners_of(const RigidTransform& board, int lacking = 0) {
    for (int i = kPlate.columns * kPlate.rows; i-- > lacking;) {
      const Vec2 at = kPlate.square_mm * Vec2(i % kPlate.columns, i / kPlate.columns);
      const int k = kPlate.columns * kPlate.rows - 1 - i;
      const Vec2 shown = kPlate.square_mm * Vec2(k % kPlate.columns, k / kPlate.columns);
      const Vec3 x = board * Vec3(at.x(), at.y(), 0);
      input_.projected_corners.push_back(
          {0, shown, {1, *truth_.projectors[0].project(x) + noise(0.1), 0.1}});
    }
  }

  /// Errors that all correspondences of a ninth of an image share.
  void share_errors(double sigma_px) {
    for (Vec2& s : shared_) s = noise(sigma_px);
  }

  Vec2 noise(double sigma) { return {random_.normal(0, sigma), random_.normal(0, sigma)}; }

  [[nodiscard]] static double distance(const Rig& rig) {
    return (rig.cameras[0].center() - rig.projectors[0].center()).norm();
  }

  [[nodiscard]] static std::size_t ninth_of(const Vec2& pixel) {
    const auto third = [](double x) {
      return static_cast<std::size_t>(std::clamp(x / 427, 0., 2.));
    };
    return 3 * third(pixel.y()) + third(pixel.x());
  }

  Rig truth_;
  CalibrationInput input_;
  double track_noise_px_ = 0.1;
  std::array<Vec2, 9> shared_;
  Random random_{5};
};

TEST_F(OnBoard, OnePoseGivesTheCameraAndNeverAGoodRig) {
  add_capture(placing(0.5, -0.5));
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  EXPECT_TRUE(result.rig.unit_known);
  EXPECT_LT(result.rms_px, 0.2);         // of 0.1 px noise in each coordinate
  EXPECT_LT(result.board_rms_px, 0.25);  // the same, less what the pose takes up
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
  EXPECT_LT(std::abs(result.rig.cameras[0].K(0, 0) - truth_.cameras[0].K(0, 0)),
            3 * sigma.devices[0].inner[kFx]);
  EXPECT_NE(judge(input_, result, sigma, {}).grade, Grade::kGood);
}

TEST_F(OnBoard, ABentBoardErrsWithinItsDeviations) {
  constexpr double kBendMm = 0.25;  // of a diagonal of 300 mm: a little less than a thousandth
  add_capture(placing(0.5, -0.5), kBendMm);
  const CalibrationResult result = calibrated();
  ASSERT_TRUE(result.solved);
  const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
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
    const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
    return std::pair(result, sigma);
  };
  const Uncertainty without = judged().second;
  add_projected_corners_of(board, 1);
  const auto [result, sigma] = judged();
  EXPECT_EQ(result.problem.board_views.size(), 125U);
  EXPECT_LT(result.board_rms_px, 0.25);
  EXPECT_NEAR(distance(result.rig) / distance(truth_), 1, 0.05);  // hangs on the focal lengths
  EXPECT_LT(std::abs(result.rig.projectors[0].K(0, 0) - 1300), 3 * sigma.devices[1].inner[kFx]);
  EXPECT_LT(sigma.volume_median, 0.7 * without.volume_median);
  // A printed board's mean square is good to half a thousandth, and the scale never better.
  const auto scale = scale_deviation(input_, result, sigma);
  ASSERT_TRUE(scale);
  EXPECT_EQ(scale->from, ScaleDeviation::From::kBoard);
  EXPECT_GT(scale->share, 0.0005);
  EXPECT_LT(scale->share, 0.02);
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

TEST_F(OnBoard, ACameraThatJoinsLaterMayNumberAllBoardsFromTheOtherEnd) {
  truth_.cameras.push_back(sample::device_at<Camera>({850, 80, 350}, "cam1", 1280, 960, 1600));
  for (const auto& [y, z] : {std::pair(0.5, 0.3), std::pair(-0.4, 0.4), std::pair(0.2, -0.6)})
    add_capture(placing(y, z));
  input_.rig = truth_;
  BundleProblem problem;
  for (std::size_t d = 0; d < device_count(truth_); ++d)
    problem.devices.push_back(bundle_device(device_at(truth_, d)));
  problem.tracks = input_.tracks;
  place_by_boards(input_, std::vector<char>(device_count(truth_), 1), problem);
  ASSERT_TRUE(problem.devices[0].present && problem.devices[1].present);
  // In the first camera's frame; a board that is half a turn off puts it hundreds of mm away.
  const Vec3 found = transform_from(problem.devices[0].pose) * center_of(problem.devices[1]);
  const Vec3 truth = truth_.cameras[0].device_from_world * truth_.cameras[1].center();
  EXPECT_LT((found - truth).norm(), 10);
}

/// What one pose of a board and a wall leave nearly free moves with errors far below the noise.
TEST_F(OnBoard, ErrorsThatNeighboursShareStayWithinTheDeviations) {
  constexpr double kSharedPx = 0.05;
  track_noise_px_ = 0.03;
  truth_.cameras[0].distortion = {-0.15, 0.1, 0, 0, 0};
  for (const std::uint64_t seed : {1, 2}) {
    random_ = Random(seed);
    input_ = {};
    share_errors(kSharedPx);
    const RigidTransform board = placing(0.5, -0.5);
    add_capture(board);
    for (int i = 0; i < 1500; ++i)  // a wall 100 mm behind the board
      add_track(board * Vec3(random_.uniform(-150, 390), random_.uniform(-150, 330), -100), 0);
    add_projected_corners_of(board);
    const CalibrationResult result = calibrated();
    ASSERT_TRUE(result.solved);
    const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
    // Residuals show a fifth of it (in squares), four numbers of eighteen.
    EXPECT_GT(sigma.shared_px, 0.2 * kSharedPx) << seed;
    EXPECT_LT(sigma.shared_px, 2 * kSharedPx) << seed;
    EXPECT_LT(result.adjustment.track_weight, 0.1);
    for (std::size_t d = 0; d < 2; ++d) {
      const BundleDevice truth = bundle_device(device_at(truth_, d));
      for (const std::size_t i : {kFx, kFy, kCx, kCy, kK1, kK2, kP1, kP2})
        EXPECT_LT(std::abs(result.problem.devices[d].inner[i] - truth.inner[i]),
                  3 * sigma.devices[d].inner[i])
            << "seed " << seed << ", device " << d << ", " << kIntrinsicNames[i];
    }
  }
}

/// A wide lens whose k3 displaces the corners by some pixels; held at 0, it bends k1 and k2.
TEST_F(OnBoard, K3OfAWideLensIsFoundWithinTheDeviations) {
  truth_.cameras[0].K(0, 0) = truth_.cameras[0].K(1, 1) = 900;
  truth_.projectors[0].K(0, 0) = truth_.projectors[0].K(1, 1) = 650;
  for (const double k3 : {-0.04, 0.03}) {
    random_ = Random(5);
    input_ = {};
    truth_.cameras[0].distortion = {-0.25, 0.12, 0, 0, k3};
    for (const auto& [y, z] : {std::pair(0.5, 0.3), std::pair(-0.4, 0.4), std::pair(0.2, -0.6)}) {
      add_capture(placing(y, z));
      for (int i = 0; i < 500; ++i)  // as far as the corners of the image
        add_track(Vec3(random_.uniform(-200, 200), random_.uniform(-600, 600),
                       random_.uniform(-450, 450)),
                  input_.boards - 1);
    }
    const CalibrationResult result = calibrated();
    ASSERT_TRUE(result.solved);
    const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
    const BundleDevice& found = result.problem.devices[0];
    EXPECT_LT(sigma.devices[0].inner[kK3], 0.02) << k3;
    for (const std::size_t i : {kK1, kK2, kK3})
      EXPECT_LT(std::abs(found.inner[i] - truth_.cameras[0].distortion[i - kK1]),
                3 * sigma.devices[0].inner[i])
          << kIntrinsicNames[i] << " " << k3;
  }
}

}  // namespace
}  // namespace pencilscan
