#include "pencilscan/calibration/pair_geometry.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "pencilscan/calibration/pair_matches.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/geometry/cross_matrix.h"

namespace pencilscan {
namespace {

/// Distance of a match to its epipolar lines as the share of each image's width, the larger one.
double epipolar_distance(const Rig& rig, const PairGeometry& pair, const PairMatch& match) {
  const Vec3 line_p = pair.fundamental * match.in_camera.homogeneous();
  const Vec3 line_c = pair.fundamental.transpose() * match.in_projector.homogeneous();
  const double error = std::abs(match.in_projector.homogeneous().dot(line_p));
  return std::max(error / line_p.head<2>().norm() / device_at(rig, pair.projector).width,
                  error / line_c.head<2>().norm() / device_at(rig, pair.camera).width);
}

/// What one homography explains.
struct Plane {
  Mat3 homography = Mat3::Zero();
  std::vector<std::uint8_t> mask;  ///< per match; empty where there is none
  [[nodiscard]] double share() const {
    return mask.empty()
               ? 0
               : static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.size());
  }
};

Plane find_plane(const std::vector<cv::Point2d>& a, const std::vector<cv::Point2d>& b,
                 double tolerance) {
  Plane plane;
  const cv::Mat H = cv::findHomography(a, b, cv::RANSAC, tolerance, plane.mask, 2000, 0.999);
  if (H.empty()) return {};
  cv::cv2eigen(H, plane.homography);
  return plane;
}

double planar_share(const std::vector<cv::Point2d>& a, const std::vector<cv::Point2d>& b,
                    double tolerance) {
  return a.size() < 8 ? 1 : find_plane(a, b, tolerance).share();
}

Vec3 homogeneous(const cv::Point2d& p) { return {p.x, p.y, 1}; }

/// Whether a match lies near its epipolar lines in both images, in their common scale.
bool is_epipolar(const Mat3& F, const cv::Point2d& a, const cv::Point2d& b, double tolerance) {
  const Vec3 line_b = F * homogeneous(a);
  const Vec3 line_a = F.transpose() * homogeneous(b);
  const double error = std::abs(homogeneous(b).dot(line_b));
  return error < tolerance * std::min(line_a.head<2>().norm(), line_b.head<2>().norm());
}

/// F = [e]x H: the lines from where the plane would show two matches to where they are meet in the
/// epipole. The one that most matches off the plane agree with.
Mat3 fundamental_by_plane(const std::vector<cv::Point2d>& a, const std::vector<cv::Point2d>& b,
                          const Plane& plane, double tolerance) {
  constexpr int kTries = 500;
  constexpr std::size_t kJudges = 500;
  std::vector<std::size_t> off;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (plane.mask[i] == 0) off.push_back(i);
  Mat3 best = Mat3::Zero();
  if (off.size() < 2) return best;
  const std::size_t judges = std::min(off.size(), kJudges);
  const auto line = [&](std::size_t i) -> Vec3 {
    return (plane.homography * homogeneous(a[i])).cross(homogeneous(b[i])).normalized();
  };
  std::size_t most = 0;
  Random random(1);
  for (int k = 0; k < kTries; ++k) {
    const auto n = static_cast<std::uint32_t>(off.size());
    const Vec3 epipole = line(off[random.below(n)]).cross(line(off[random.below(n)]));
    if (epipole.norm() < 1e-12) continue;
    const Mat3 F = cross_matrix(epipole.normalized()) * plane.homography;
    std::size_t agreeing = 0;
    for (std::size_t j = 0; j < judges; ++j) {
      const std::size_t i = off[j * off.size() / judges];
      agreeing += is_epipolar(F, a[i], b[i], tolerance) ? 1U : 0U;
    }
    if (agreeing <= most) continue;
    most = agreeing;
    best = F;
  }
  return best;
}

std::size_t agreeing_matches(const Mat3& F, const std::vector<cv::Point2d>& a,
                             const std::vector<cv::Point2d>& b, double tolerance) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    count += is_epipolar(F, a[i], b[i], tolerance) ? 1U : 0U;
  return count;
}

/// By RANSAC, widths of both images taken as 1000; zero where there is none.
Mat3 find_fundamental(const std::vector<cv::Point2d>& a, const std::vector<cv::Point2d>& b,
                      const PairGeometryOptions& options) {
  constexpr double kDominant = 0.5;  // of the matches
  std::vector<std::uint8_t> mask;
  const double tolerance = 1000 * options.tolerance;
  const cv::Mat found = cv::findFundamentalMat(a, b, cv::FM_RANSAC, tolerance, 0.9999, 2000, mask);
  if (found.rows != 3 || found.cols != 3) return Mat3::Zero();
  Mat3 F;
  cv::cv2eigen(found, F);
  const Plane plane = find_plane(a, b, 1000 * options.planar_tolerance);
  if (plane.share() < kDominant) return F;
  const Mat3 by_plane = fundamental_by_plane(a, b, plane, tolerance);
  return agreeing_matches(by_plane, a, b, tolerance) > agreeing_matches(F, a, b, tolerance)
             ? by_plane
             : F;
}

void solve_pair(const Rig& rig, const std::vector<PairMatch>& matches, PairGeometry& pair,
                const PairGeometryOptions& options) {
  pair.matches = matches.size();
  if (matches.size() < options.least_matches) return;
  const double width_c = device_at(rig, pair.camera).width;
  const double width_p = device_at(rig, pair.projector).width;
  // Widths alike, so that one tolerance holds on both sides.
  std::vector<cv::Point2d> a;
  std::vector<cv::Point2d> b;
  for (const PairMatch& m : matches) {
    a.emplace_back(m.in_camera.x() * 1000 / width_c, m.in_camera.y() * 1000 / width_c);
    b.emplace_back(m.in_projector.x() * 1000 / width_p, m.in_projector.y() * 1000 / width_p);
  }
  const Mat3 F = find_fundamental(a, b, options);
  if (F.isZero()) return;
  const Vec3 to_c(1000 / width_c, 1000 / width_c, 1);
  const Vec3 to_p(1000 / width_p, 1000 / width_p, 1);
  pair.fundamental = to_p.asDiagonal() * F * to_c.asDiagonal();
  std::vector<cv::Point2d> inlier_a;
  std::vector<cv::Point2d> inlier_b;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (epipolar_distance(rig, pair, matches[i]) > options.tolerance) continue;
    inlier_a.push_back(a[i]);
    inlier_b.push_back(b[i]);
  }
  pair.inliers = inlier_a.size();
  pair.planar_share = planar_share(inlier_a, inlier_b, 1000 * options.planar_tolerance);
}

/// How unequal the two large singular values of an almost essential matrix are, in [0, 1].
double inequality(const Mat3& E) {
  const Vec3 s = Eigen::JacobiSVD<Mat3>(E).singularValues();
  return (s[0] - s[1]) / s[0];
}

Mat3 camera_matrix(double focal, double cx, double cy) {
  Mat3 K = Mat3::Identity();
  K(0, 0) = K(1, 1) = focal;
  K(0, 2) = cx;
  K(1, 2) = cy;
  return K;
}

}  // namespace

std::vector<PairGeometry> pair_geometries(const Rig& rig, std::span<const Track> tracks,
                                          const PairGeometryOptions& options) {
  const auto matches = matches_by_pair(tracks);
  std::vector<PairGeometry> pairs;
  std::vector<const std::vector<PairMatch>*> lists;
  for (const auto& [key, list] : matches) {
    pairs.emplace_back().camera = key.first;
    pairs.back().projector = key.second;
    lists.push_back(&list);
  }
  parallel_for(pairs.size(), [&](std::size_t i) { solve_pair(rig, *lists[i], pairs[i], options); });
  return pairs;
}

void drop_epipolar_outliers(const Rig& rig, std::span<const PairGeometry> pairs, double least_share,
                            std::vector<Track>& tracks, const PairFit* fit,
                            const PairGeometryOptions& options) {
  std::map<DevicePair, const PairGeometry*> by_key;
  for (const PairGeometry& pair : pairs) by_key[{pair.camera, pair.projector}] = &pair;
  std::vector<Track> kept;
  for (Track& track : tracks) {
    Track cleaned{{track.views[0]}, track.capture};
    for (std::size_t i = 1; i < track.views.size(); ++i) {
      const auto found = by_key.find(pair_of(track, track.views[i]));
      if (found == by_key.end()) continue;
      const PairGeometry& pair = *found->second;
      if (pair.inliers < options.least_matches || pair.inlier_share() < least_share) continue;
      const PairMatch match = match_of(track, track.views[i]);
      if (epipolar_distance(rig, pair, match) > options.tolerance &&
          (fit == nullptr || !fit->explains(found->first, match)))
        continue;
      cleaned.views.push_back(track.views[i]);
    }
    if (cleaned.views.size() > 1) kept.push_back(std::move(cleaned));
  }
  tracks = std::move(kept);
}

Rig rig_with_guess(const Rig& rig, const FocalGuess& guess, const std::vector<char>& known) {
  Rig result = rig;
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    if (known[d] != 0) continue;
    Device& device = device_at(result, d);
    const bool is_camera = d < rig.cameras.size();
    const double focal = (is_camera ? guess.camera_scale : guess.projector_scale) * device.width;
    device.K = camera_matrix(
        focal, (device.width - 1) / 2.0,
        (device.height - 1) / 2.0 + (is_camera ? 0 : guess.lens_shift * device.height));
    device.distortion = {};
  }
  return result;
}

std::vector<FocalGuess> guess_focal_lengths(const Rig& rig, std::span<const PairGeometry> pairs,
                                            const std::vector<char>& known) {
  constexpr std::array<double, 7> kScales{0.7, 1.0, 1.4, 1.8, 2.3, 3.0, 4.0};
  constexpr std::array<double, 5> kShifts{0, 0.3, 0.6, -0.3, -0.6};
  constexpr double kUsualScale = 1.6;   // of cameras and projectors: a field of view of 35 degrees
  constexpr double kScaleSpread = 0.6;  // natural logarithm
  constexpr double kShiftSpread = 0.4;
  constexpr double kPriorWeight = 0.003;
  const std::size_t cameras = rig.cameras.size();
  const bool all_cameras = std::all_of(known.begin(), known.begin() + std::ptrdiff_t(cameras),
                                       [](char k) { return k != 0; });
  const bool all_projectors = std::all_of(known.begin() + std::ptrdiff_t(cameras), known.end(),
                                          [](char k) { return k != 0; });
  std::vector<FocalGuess> guesses;
  for (std::size_t a = 0; a < (all_cameras ? 1 : kScales.size()); ++a) {
    for (std::size_t b = 0; b < (all_projectors ? 1 : kScales.size()); ++b) {
      for (std::size_t s = 0; s < (all_projectors ? 1 : kShifts.size()); ++s) {
        FocalGuess guess{kScales[a], kScales[b], kShifts[s], 0};
        const auto unusual = [&](double scale) {
          const double z = std::log(scale / kUsualScale) / kScaleSpread;
          return z * z;
        };
        if (!all_cameras) guess.cost += kPriorWeight * unusual(guess.camera_scale);
        if (!all_projectors)
          guess.cost += kPriorWeight * (unusual(guess.projector_scale) +
                                        std::pow(guess.lens_shift / kShiftSpread, 2));
        guesses.push_back(guess);
      }
    }
  }
  parallel_for(guesses.size(), [&](std::size_t g) {
    const Rig guessed = rig_with_guess(rig, guesses[g], known);
    double sum = 0;
    double weights = 0;
    for (const PairGeometry& pair : pairs) {
      if (pair.inliers < 50) continue;
      const Mat3 E = device_at(guessed, pair.projector).K.transpose() * pair.fundamental *
                     device_at(guessed, pair.camera).K;
      sum += std::min(inequality(E), 0.5);
      weights += 1;
    }
    if (weights > 0) guesses[g].cost += sum / weights;
  });
  std::stable_sort(guesses.begin(), guesses.end(),
                   [](const FocalGuess& x, const FocalGuess& y) { return x.cost < y.cost; });
  return guesses;
}

}  // namespace pencilscan
