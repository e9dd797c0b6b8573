#include "pencilscan/calibration/board_start.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "pencilscan/bundle/board_corners.h"
#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/board_sightings.h"
#include "pencilscan/calibration/rig_frame.h"
#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

/// Whether a pixel lies on the board as a sighting shows it.
class BoardOutline {
 public:
  BoardOutline(const std::vector<BoardView>& views, const BoardSighting& s) {
    std::vector<cv::Point2f> corners;
    for (const std::size_t i : s.views)
      corners.emplace_back(static_cast<float>(views[i].view.pixel.x()),
                           static_cast<float>(views[i].view.pixel.y()));
    cv::convexHull(corners, hull_);
  }
  [[nodiscard]] bool contains(const Vec2& pixel) const {
    return cv::pointPolygonTest(
               hull_, {static_cast<float>(pixel.x()), static_cast<float>(pixel.y())}, false) > 0;
  }

 private:
  std::vector<cv::Point2f> hull_;
};

/// Where a pixel's ray meets the board's plane; nothing behind the device.
std::optional<Vec3> on_board(const BundleDevice& device, const Vec2& pixel,
                             const RigidTransform& world_from_board) {
  const Vec3 normal = world_from_board.rotation.col(2);
  const Vec3 origin = center_of(device);
  const Vec3 direction = rotation_of(device).transpose() * device_ray(device, pixel);
  const double t = normal.dot(world_from_board.translation - origin) / normal.dot(direction);
  if (!std::isfinite(t) || t <= 0) return std::nullopt;
  return origin + t * direction;
}

/// Correspondences of a device with places on the boards (mm), by board.
struct PlanePoints {
  std::vector<cv::Point2d> on_board;
  std::vector<cv::Point2d> pixels;
};

std::map<std::size_t, PlanePoints> plane_points(const BundleProblem& problem,
                                                const std::vector<BoardSighting>& sightings,
                                                std::size_t device) {
  std::map<std::size_t, PlanePoints> by_board;
  for (const BoardSighting& s : sightings) {
    if (!problem.devices[s.device].present) continue;
    const BoardOutline outline(problem.board_views, s);
    const RigidTransform world_from_board = transform_from(problem.board_poses[s.board]);
    const RigidTransform board_from_world = world_from_board.inverse();
    for (const Track& track : problem.tracks) {
      if (track.capture != s.board) continue;
      const TrackView* from = view_in(track, s.device);
      const TrackView* to = view_in(track, device);
      if (from == nullptr || to == nullptr || !outline.contains(from->pixel)) continue;
      const auto x = on_board(problem.devices[s.device], from->pixel, world_from_board);
      if (!x) continue;
      const Vec3 local = board_from_world * *x;
      by_board[s.board].on_board.emplace_back(local.x(), local.y());
      by_board[s.board].pixels.emplace_back(to->pixel.x(), to->pixel.y());
    }
  }
  return by_board;
}

/// How far the first two columns of K^-1 H are from perpendicular and equally long.
double homography_cost(const Mat3& H, double focal, const Vec2& center) {
  Mat3 K_inverse;
  K_inverse << 1 / focal, 0, -center.x() / focal, 0, 1 / focal, -center.y() / focal, 0, 0, 1;
  const Vec3 a = K_inverse * H.col(0);
  const Vec3 b = K_inverse * H.col(1);
  const double lengths = std::log(a.norm() / b.norm());
  const double cosine = a.dot(b) / (a.norm() * b.norm());
  return lengths * lengths + cosine * cosine;
}

/// Focal length and lens shift that make the homographies those of planes, on a grid.
void choose_inner(const std::vector<Mat3>& homographies, BundleDevice& device) {
  constexpr int kSteps = 80;
  double best = std::numeric_limits<double>::infinity();
  const double width = device.width;
  const double height = device.height;
  for (int i = 0; i <= kSteps; ++i) {
    const double focal = width * 0.5 * std::pow(10.0, static_cast<double>(i) / kSteps);
    for (int j = 0; j <= kSteps; ++j) {
      const double shift = -0.75 + 1.5 * j / kSteps;  // image heights below the centre
      const Vec2 center(device.prior[kCx], (height - 1) / 2 + shift * height);
      // One plane may allow two pairs: what is usual decides.
      const double unusual = std::log(focal / (1.5 * width));
      double cost = 1e-4 * (shift * shift + unusual * unusual);
      for (const Mat3& H : homographies) cost += homography_cost(H, focal, center);
      if (cost >= best) continue;
      best = cost;
      device.inner[kFx] = device.inner[kFy] = focal;
      device.inner[kCx] = center.x();
      device.inner[kCy] = center.y();
    }
  }
}

/// device_from_board.
RigidTransform pose_from_homography(const Mat3& H, const BundleDevice& device) {
  Mat3 columns = K_of(device).inverse() * H;
  columns /= std::sqrt(columns.col(0).norm() * columns.col(1).norm());
  if (columns(2, 2) < 0) columns = -columns;
  Mat3 R;
  R << columns.col(0), columns.col(1), columns.col(0).cross(columns.col(1));
  const Eigen::JacobiSVD<Mat3> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) rotation.col(2) = -rotation.col(2);
  return {rotation, columns.col(2)};
}

void place_from_plane(const CalibrationInput& input, const std::vector<BoardSighting>& sightings,
                      std::size_t d, bool is_known, BundleProblem& problem) {
  constexpr std::size_t kFewest = 12;
  std::vector<Mat3> homographies;
  std::size_t most = 0;
  std::size_t board = 0;
  Mat3 of_most;
  for (const auto& [b, points] : plane_points(problem, sightings, d)) {
    if (points.pixels.size() < kFewest) continue;
    const double tolerance = 0.005 * device_at(input.rig, d).width;  // lenses bend
    const cv::Mat found = cv::findHomography(points.on_board, points.pixels, cv::RANSAC, tolerance);
    if (found.empty()) continue;
    Mat3 H;
    cv::cv2eigen(found, H);
    homographies.push_back(H);
    if (points.pixels.size() <= most) continue;
    most = points.pixels.size();
    board = b;
    of_most = H;
  }
  if (most == 0) return;
  BundleDevice& device = problem.devices[d];
  if (!is_known) {
    choose_inner(homographies, device);
    device.prior_sigma[kFx] *= device.inner[kFx] / device.prior[kFx];
    device.prior[kFx] = device.inner[kFx];
  }
  const RigidTransform pose =
      pose_from_homography(of_most, device) * transform_from(problem.board_poses[board]).inverse();
  set_pose(device, pose.rotation, pose.translation);
  device.present = true;
}

}  // namespace

std::vector<char> focal_lengths_from_boards(const CalibrationInput& input, Rig& rig) {
  std::vector<char> known;
  for (const GivenCalibration& k : input.known) known.push_back(k.K ? 1 : 0);
  std::map<std::size_t,
           std::map<std::size_t, std::pair<std::vector<cv::Point3f>, std::vector<cv::Point2f>>>>
      by_camera;
  for (const BoardView& v : input.board_views) {
    if (known[v.view.device] != 0) continue;
    auto& [points, pixels] = by_camera[v.view.device][v.board];
    points.emplace_back(static_cast<float>(v.position_mm.x()),
                        static_cast<float>(v.position_mm.y()), 0.F);
    pixels.emplace_back(static_cast<float>(v.view.pixel.x()), static_cast<float>(v.view.pixel.y()));
  }
  for (const auto& [camera, boards] : by_camera) {
    std::vector<std::vector<cv::Point3f>> points;
    std::vector<std::vector<cv::Point2f>> pixels;
    for (const auto& [board, seen] : boards) {
      points.push_back(seen.first);
      pixels.push_back(seen.second);
    }
    Device& device = device_at(rig, camera);
    const double width = device.width;
    cv::Mat K = (cv::Mat_<double>(3, 3) << 1.5 * width, 0, (width - 1) / 2, 0, 1.5 * width,
                 (device.height - 1) / 2.0, 0, 0, 1);
    cv::Mat distortion;
    std::vector<cv::Mat> rotations;
    std::vector<cv::Mat> translations;
    cv::calibrateCamera(
        points, pixels, {device.width, device.height}, K, distortion, rotations, translations,
        cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_ASPECT_RATIO | cv::CALIB_FIX_PRINCIPAL_POINT |
            cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K1 | cv::CALIB_FIX_K2 | cv::CALIB_FIX_K3);
    const double focal = K.at<double>(0, 0);
    // A board seen square on says nothing of the focal length.
    if (!(focal > 0.4 * width && focal < 8 * width)) continue;
    cv::cv2eigen(K, device.K);
    known[camera] = 1;
  }
  return known;
}

void place_by_boards(const CalibrationInput& input, const std::vector<char>& known,
                     BundleProblem& problem) {
  problem.board_views = input.board_views;
  problem.board_poses.assign(input.boards, {});
  const std::vector<char> has_pose = grow_from_boards(problem);
  std::erase_if(problem.board_views, [&](const BoardView& v) { return has_pose[v.board] == 0; });
  const std::vector<BoardSighting> placed = sightings_of(problem.board_views);
  for (std::size_t d = input.rig.cameras.size(); d < problem.devices.size(); ++d)
    place_from_plane(input, placed, d, known[d] != 0, problem);
}

void attach_boards(const CalibrationInput& input, BundleProblem& problem) {
  constexpr std::size_t kFewest = 8;
  problem.board_views = input.board_views;
  problem.board_poses.assign(input.boards, {});
  struct Seen {
    BoardSighting sighting;
    RigidTransform pose;
    std::size_t tracks = 0;
  };
  std::vector<Seen> seen;
  std::vector<double> scales;  // mm per unit of the structure
  for (const BoardSighting& s : sightings_of(problem.board_views)) {
    const BundleDevice& device = problem.devices[s.device];
    if (!device.present) continue;
    const auto pose = camera_from_board(problem, s);
    if (!pose) continue;
    const BoardOutline outline(problem.board_views, s);
    const RigidTransform camera_from_world = transform_from(device.pose);
    Seen& added = seen.emplace_back(Seen{s, *pose});
    for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
      if (problem.used[t] == 0 || problem.tracks[t].capture != s.board) continue;
      const TrackView* view = view_in(problem.tracks[t], s.device);
      if (view == nullptr || !outline.contains(view->pixel)) continue;
      const double depth = (camera_from_world * problem.points[t]).z();
      const Vec3 ray = device_ray(device, view->pixel);
      const Vec3 normal = pose->rotation.col(2);
      scales.push_back(normal.dot(pose->translation) / normal.dot(ray) / depth);
      ++added.tracks;
    }
  }
  problem.board_views.clear();
  if (scales.size() < kFewest) return problem.board_poses.clear();
  const double scale = upper_median(std::move(scales));
  if (!std::isfinite(scale) || !(scale > 0)) return problem.board_poses.clear();
  move_solution(scale, {}, problem);
  // The view with most of the correspondences places its board; other cameras follow.
  std::stable_sort(seen.begin(), seen.end(),
                   [](const Seen& a, const Seen& b) { return a.tracks > b.tracks; });
  problem.board_views = input.board_views;
  std::vector<char> has_pose(input.boards, 0);
  for (const Seen& s : seen) {
    if (has_pose[s.sighting.board] != 0) {
      agree_on_end(s.sighting, problem);
      continue;
    }
    const BundleDevice& device = problem.devices[s.sighting.device];
    const RigidTransform camera_from_world = transform_from(device.pose);
    problem.board_poses[s.sighting.board] = pose_from(camera_from_world.inverse() * s.pose);
    has_pose[s.sighting.board] = 1;
  }
  std::erase_if(problem.board_views, [&](const BoardView& v) { return has_pose[v.board] == 0; });
}

void add_projected_corners(const CalibrationInput& input, BundleProblem& problem) {
  std::set<std::size_t> placed;
  for (const BoardView& v : problem.board_views) placed.insert(v.board);
  for (const BoardView& v : input.projected_corners)
    if (placed.contains(v.board) && problem.devices[v.view.device].present)
      problem.board_views.push_back(v);
  for (const BoardSighting& s : sightings_of(problem.board_views))
    if (s.device >= input.rig.cameras.size()) agree_on_end(s, problem);
}

void rescale_to_boards(BundleProblem& problem) {
  constexpr std::size_t kFewest = 8;
  if (problem.board_views.empty() || boards_join_devices(problem.board_views)) return;
  std::map<std::size_t, std::pair<std::size_t, RigidTransform>> in_camera;  // of boards, as found
  std::vector<double> scales;
  for (const BoardSighting& s : sightings_of(problem.board_views)) {
    const BundleDevice& device = problem.devices[s.device];
    if (!device.present) continue;
    const RigidTransform camera_from_world = transform_from(device.pose);
    const RigidTransform pose = camera_from_world * transform_from(problem.board_poses[s.board]);
    in_camera[s.board] = {s.device, pose};
    const BoardOutline outline(problem.board_views, s);
    const Vec3 normal = pose.rotation.col(2);
    for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
      if (problem.used[t] == 0 || problem.tracks[t].capture != s.board) continue;
      const TrackView* view = view_in(problem.tracks[t], s.device);
      if (view == nullptr || !outline.contains(view->pixel)) continue;
      scales.push_back(normal.dot(pose.translation) / normal.dot(device_ray(device, view->pixel)) /
                       (camera_from_world * problem.points[t]).z());
    }
  }
  if (scales.size() < kFewest) return;
  const double scale = upper_median(std::move(scales));
  if (!std::isfinite(scale) || !(scale > 0)) return;
  move_solution(scale, {}, problem);
  for (const auto& [board, seen] : in_camera)
    problem.board_poses[board] =
        pose_from(transform_from(problem.devices[seen.first].pose).inverse() * seen.second);
}

}  // namespace pencilscan
