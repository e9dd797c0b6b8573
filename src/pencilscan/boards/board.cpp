#include "pencilscan/boards/board.h"

#include <cmath>
#include <cstdio>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/boards/board_dictionary.h"
#include "pencilscan/core/error.h"
#include "pencilscan/gray/local_map.h"

namespace pencilscan {
namespace {

/// The image in bytes. A projector lights part of the scene only: the brightest hundredth must not
/// set the range. Empty when all is dark.
cv::Mat stretched(const cv::Mat& image) {
  cv::Mat sorted;
  cv::sort(image.reshape(1, 1), sorted, cv::SORT_EVERY_ROW | cv::SORT_ASCENDING);
  const float bright = sorted.at<float>(0, static_cast<int>(0.99 * (sorted.cols - 1)));
  cv::Mat bytes;
  if (bright > 0) image.convertTo(bytes, CV_8U, 255.0 / bright);
  return bytes;
}

std::vector<BoardCorner> find_chessboard(const cv::Mat& bytes, const CalibrationBoard& board) {
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
  std::vector<BoardCorner> result;
  for (int i = 0; i < static_cast<int>(corners.size()); ++i) {
    const cv::Point2f& corner = corners[static_cast<std::size_t>(i)];
    result.push_back({i % board.columns, i / board.columns, {corner.x, corner.y}});
  }
  return result;
}

}  // namespace

CalibrationBoard board_from_text(const std::string& text, const std::string& field) {
  constexpr int kFewest = 3;
  constexpr int kMost = 100;
  CalibrationBoard board;
  BoardMarkers markers;
  std::array<char, 32> dictionary{};
  int used = 0;
  const bool has_markers = text.starts_with("charuco:");
  const int fields =
      has_markers
          ? std::sscanf(text.c_str(), "charuco:%dx%d:%lf:%lf:%31[A-Za-z0-9_]%n", &board.columns,
                        &board.rows, &board.square_mm, &markers.side_mm, dictionary.data(), &used)
          : std::sscanf(text.c_str(), "chessboard:%dx%d:%lf%n", &board.columns, &board.rows,
                        &board.square_mm, &used);
  const bool is_whole = fields == (has_markers ? 5 : 3) && std::size_t(used) == text.size();
  if (has_markers) {  // counted in squares
    --board.columns;
    --board.rows;
    markers.dictionary = dictionary.data();
    board.markers = markers;
  }
  const bool is_sound = is_whole && board.columns >= kFewest && board.rows >= kFewest &&
                        board.columns <= kMost && board.rows <= kMost && board.square_mm > 0 &&
                        std::isfinite(board.square_mm);
  if (!is_sound || (has_markers && !(markers.side_mm > 0 && markers.side_mm < board.square_mm)))
    throw InputError("command line", field, text,
                     "must be chessboard:COLUMNSxROWS:MM, inner corners (3 to 100) and the side of "
                     "a square > 0, as chessboard:9x7:75, or charuco:COLUMNSxROWS:MM:MARKER_MM:"
                     "DICTIONARY, squares (4 to 101), as charuco:10x8:75:56:DICT_5X5_100");
  if (!has_markers) return board;
  const auto id = dictionary_id(markers.dictionary);
  if (!id)
    throw InputError("command line", field, markers.dictionary,
                     "must be a dictionary of OpenCV, as DICT_5X5_100 or DICT_APRILTAG_36h11");
  const int needed = ((board.columns + 1) * (board.rows + 1) + 1) / 2;
  const int there = cv::aruco::getPredefinedDictionary(*id)->bytesList.rows;
  if (needed > there)
    throw InputError("command line", field, text,
                     "the dictionary has " + std::to_string(there) + " markers, the board " +
                         std::to_string(needed));
  return board;
}

std::vector<BoardCorner> find_board(const cv::Mat& image, const CalibrationBoard& board) {
  const cv::Mat bytes = stretched(image);
  if (bytes.empty()) return {};
  return board.markers ? find_charuco(bytes, board) : find_chessboard(bytes, board);
}

void BoardFinder::look(std::size_t capture, std::size_t camera, const cv::Mat& image) {
  std::vector<BoardCorner>* known = nullptr;
  const std::pair key(capture, camera);
  if (const auto at = corners_.find(key); at != corners_.end()) known = &at->second;
  const auto all = static_cast<std::size_t>(board_.columns) * static_cast<std::size_t>(board_.rows);
  if (known != nullptr && known->size() == all) return;
  std::vector<BoardCorner> corners = find_board(image, board_);
  if (corners.empty()) return;
  if (known == nullptr) {
    corners_.emplace(key, std::move(corners));
  } else if (corners.size() > known->size()) {
    *known = std::move(corners);
  }
}

void BoardFinder::project(std::size_t capture, std::size_t camera, std::size_t projector,
                          const DecodedView& decoded) {
  constexpr std::size_t kFewest = 8;
  const auto seen = corners_.find({capture, camera});
  if (seen == corners_.end()) return;
  std::vector<BoardCorner> corners;
  for (const BoardCorner& corner : seen->second) {
    const auto map = LocalMap::fit(decoded, static_cast<int>(std::lround(corner.pixel.x())),
                                   static_cast<int>(std::lround(corner.pixel.y())));
    if (map) corners.push_back({corner.column, corner.row, map->panel_from_camera(corner.pixel)});
  }
  std::vector<BoardCorner>& best = projected_[{capture, projector}];
  if (corners.size() >= kFewest && corners.size() > best.size()) best = std::move(corners);
}

std::vector<BoardView> BoardFinder::views_of(const Corners& all) const {
  constexpr double kCornerSigmaPx = 0.1;
  std::vector<BoardView> views;
  for (const auto& [key, corners] : all)
    for (const BoardCorner& corner : corners)
      views.push_back({key.first,
                       board_.square_mm * Vec2(corner.column, corner.row),
                       {key.second, corner.pixel, kCornerSigmaPx}});
  return views;
}

}  // namespace pencilscan
