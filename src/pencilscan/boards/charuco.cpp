#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "pencilscan/boards/board.h"
#include "pencilscan/boards/board_dictionary.h"

namespace pencilscan {
namespace {

struct DictionaryName {
  const char* name;
  int id;
};
constexpr std::array<DictionaryName, 21> kDictionaries{{
    {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"DICT_APRILTAG_16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"DICT_APRILTAG_25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"DICT_APRILTAG_36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"DICT_APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11},
}};

/// Markers of an image, and where they are on the board, in squares from the first inner corner.
struct MarkerMatches {
  std::vector<cv::Point2f> on_board;  ///< four to a marker
  std::vector<cv::Point2f> pixels;
};

/// Marker k stands in the k-th white square, row by row; `parity` is that of column + row there.
MarkerMatches match_markers(const CalibrationBoard& board, int parity, const std::vector<int>& ids,
                            const std::vector<std::vector<cv::Point2f>>& corners) {
  std::vector<cv::Point> squares;
  for (int row = 0; row <= board.rows; ++row)
    for (int column = 0; column <= board.columns; ++column)
      if ((column + row) % 2 == parity) squares.emplace_back(column, row);
  const auto gap = static_cast<float>(0.5 * (1 - board.markers->side_mm / board.square_mm));
  const std::array<cv::Point2f, 4> places{
      {{gap, gap}, {1 - gap, gap}, {1 - gap, 1 - gap}, {gap, 1 - gap}}};  // clockwise
  MarkerMatches matches;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < 0 || std::size_t(ids[i]) >= squares.size()) continue;
    const cv::Point2f square = squares[std::size_t(ids[i])];
    for (std::size_t k = 0; k < 4; ++k) {
      matches.on_board.push_back(square + places[k] - cv::Point2f(1, 1));
      matches.pixels.push_back(corners[i][k]);
    }
  }
  return matches;
}

/// Without the markers that the board's plane cannot explain; lenses may bend it by a part of a
/// square.
MarkerMatches consistent(const MarkerMatches& matches) {
  constexpr double kToleranceSquares = 0.25;
  constexpr std::size_t kFewestCorners = 8;
  MarkerMatches kept;
  if (matches.pixels.size() < kFewestCorners) return kept;
  cv::Mat inliers;
  // To the board, so that the tolerance means the same in all of the image.
  const cv::Mat H =
      cv::findHomography(matches.pixels, matches.on_board, cv::RANSAC, kToleranceSquares, inliers);
  if (H.empty()) return kept;
  for (std::size_t i = 0; i + 3 < matches.pixels.size(); i += 4) {
    const auto at = static_cast<int>(i);
    bool is_whole = true;
    for (int k = 0; k < 4; ++k) is_whole = is_whole && inliers.at<uchar>(at + k) != 0;
    if (!is_whole) continue;
    for (std::size_t k = i; k < i + 4; ++k) {
      kept.on_board.push_back(matches.on_board[k]);
      kept.pixels.push_back(matches.pixels[k]);
    }
  }
  return kept;
}

/// Where an inner corner should be, by the markers around it, and how far from it no other edge
/// is, px. Nothing without a marker in a square that touches it.
struct PredictedCorner {
  cv::Point2f pixel;
  double free_px = 0;
};
std::optional<PredictedCorner> predict(const MarkerMatches& markers, cv::Point2f corner) {
  constexpr double kTouches = 1.42;  // squares, to the farther corners of a touching marker
  constexpr double kNear = 2.6;
  MarkerMatches around;
  double nearest = 1e9;
  bool has_touching = false;
  for (std::size_t i = 0; i + 3 < markers.pixels.size(); i += 4) {
    double farthest = 0;
    for (std::size_t k = i; k < i + 4; ++k)
      farthest = std::max(farthest, cv::norm(markers.on_board[k] - corner));
    if (farthest > kNear) continue;
    has_touching = has_touching || farthest < kTouches;
    for (std::size_t k = i; k < i + 4; ++k) {
      around.on_board.push_back(markers.on_board[k]);
      around.pixels.push_back(markers.pixels[k]);
    }
  }
  if (!has_touching) return std::nullopt;
  const cv::Mat H = cv::findHomography(around.on_board, around.pixels, 0);
  if (H.empty()) return std::nullopt;
  std::vector<cv::Point2f> pixel;
  cv::perspectiveTransform(std::vector<cv::Point2f>{corner}, pixel, H);
  for (const cv::Point2f& other : around.pixels)
    nearest = std::min(nearest, cv::norm(other - pixel[0]));
  return PredictedCorner{pixel[0], nearest};
}

}  // namespace

std::optional<int> dictionary_id(const std::string& name) {
  const auto* at = std::find_if(kDictionaries.begin(), kDictionaries.end(),
                                [&](const DictionaryName& d) { return name == d.name; });
  if (at == kDictionaries.end()) return std::nullopt;
  return at->id;
}

std::vector<BoardCorner> find_charuco(const cv::Mat& bytes, const CalibrationBoard& board) {
  constexpr std::size_t kFewest = 8;
  const auto dictionary =
      cv::aruco::getPredefinedDictionary(dictionary_id(board.markers->dictionary).value());
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> marker_corners;
  cv::aruco::detectMarkers(bytes, dictionary, marker_corners, ids);
  // The first square is black; in older boards of an even number of rows it is white.
  MarkerMatches markers = consistent(match_markers(board, 1, ids, marker_corners));
  if ((board.rows + 1) % 2 == 0) {
    MarkerMatches older = consistent(match_markers(board, 0, ids, marker_corners));
    if (older.pixels.size() > markers.pixels.size()) markers = std::move(older);
  }
  std::vector<BoardCorner> found;
  std::set<int> columns;
  std::set<int> rows;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      const auto corner = predict(markers, cv::Point2f(cv::Point(column, row)));
      if (!corner || !cv::Rect2f(cv::Point2f(), cv::Size2f(bytes.size())).contains(corner->pixel))
        continue;
      // As far as no marker reaches.
      const int half = static_cast<int>(std::floor(0.7 * corner->free_px / std::sqrt(2.0)));
      if (half < 2) continue;
      constexpr int kLargestHalf = 10;
      std::vector<cv::Point2f> place{corner->pixel};
      const int window = std::min(half, kLargestHalf);
      cv::cornerSubPix(bytes, place, {window, window}, {-1, -1},
                       {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 50, 1e-3});
      if (cv::norm(place[0] - corner->pixel) > window) continue;
      found.push_back({column, row, {place[0].x, place[0].y}});
      columns.insert(column);
      rows.insert(row);
    }
  }
  if (found.size() < kFewest || columns.size() < 2 || rows.size() < 2) return {};
  return found;
}

}  // namespace pencilscan
