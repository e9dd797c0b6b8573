#include "pencilscan/boards/board.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "pencilscan/boards/board_dictionary.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/median.h"
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

/// The middle of a square, and around it as far as blurred edges stay out; in squares.
constexpr std::array kInSquare = {-0.2, 0.0, 0.2};

/// A chessboard in an image where its corners say.
class SeenSquares {
 public:
  SeenSquares(const std::vector<BoardCorner>& corners, const cv::Mat& image,
              const CalibrationBoard& board)
      : corners_(corners), image_(image), board_(board) {}

  /// How much of what varies in the squares around a corner is that they are bright and dark in
  /// turns: 1 of a sharp picture without noise. Nothing where the image does not show all four.
  [[nodiscard]] std::optional<double> contrast_share(int column, int row) const {
    double sum = 0;
    double squares = 0;
    double in_turns = 0;
    int count = 0;
    for (const int right : {0, 1}) {
      for (const int down : {0, 1}) {
        for (const double dx : kInSquare) {
          for (const double dy : kInSquare) {
            const auto value = at(column + right - 0.5 + dx, row + down - 0.5 + dy);
            if (!value) return std::nullopt;
            sum += *value;
            squares += *value * *value;
            in_turns += right == down ? *value : -*value;
            ++count;
          }
        }
      }
    }
    const double variance = squares / count - sum * sum / count / count;
    return variance > 0 ? in_turns * in_turns / count / count / variance : 0;
  }

  /// How much brighter every other square of a row is than those between. Its middle is at `place`,
  /// and it runs down the board or along it. Nothing where the image does not show all of it.
  [[nodiscard]] std::optional<double> alternation(bool runs_down, double place) const {
    double difference = 0;
    const int squares = 1 + (runs_down ? board_.rows : board_.columns);
    for (int k = 0; k < squares; ++k) {
      double sum = 0;
      for (const double along : kInSquare) {
        for (const double across : kInSquare) {
          const double x = k - 0.5 + along;
          const auto value = runs_down ? at(place + across, x) : at(x, place + across);
          if (!value) return std::nullopt;
          sum += *value;
        }
      }
      // Of an odd number, one kind has a square more.
      const int of_kind = k % 2 == 0 ? (squares + 1) / 2 : squares / 2;
      difference += (k % 2 == 0 ? sum : -sum) / of_kind;
    }
    return difference;
  }

 private:
  /// The image's value at a place in squares from the first corner; from the four corners next to
  /// it, so that lenses may bend the board.
  [[nodiscard]] std::optional<double> at(double x, double y) const {
    const int column = std::clamp(static_cast<int>(std::floor(x)), 0, board_.columns - 2);
    const int row = std::clamp(static_cast<int>(std::floor(y)), 0, board_.rows - 2);
    const auto corner = [&](int i, int j) {
      return corners_[static_cast<std::size_t>((row + j) * board_.columns + column + i)].pixel;
    };
    const double u = x - column;
    const double v = y - row;
    const Vec2 pixel = (1 - v) * ((1 - u) * corner(0, 0) + u * corner(1, 0)) +
                       v * ((1 - u) * corner(0, 1) + u * corner(1, 1));
    const cv::Point place(cvRound(pixel.x()), cvRound(pixel.y()));
    if (!cv::Rect(0, 0, image_.cols, image_.rows).contains(place)) return std::nullopt;
    return image_.at<float>(place);
  }

  const std::vector<BoardCorner>& corners_;
  const cv::Mat& image_;
  const CalibrationBoard& board_;
};

}  // namespace

bool are_all_corners(const std::vector<BoardCorner>& corners, const cv::Mat& image,
                     const CalibrationBoard& board) {
  constexpr double kHalf = 0.5;  // between 1 of right corners and 0 of others
  const SeenSquares seen(corners, image, board);
  std::vector<double> shares;
  for (const BoardCorner& corner : corners)
    if (const auto share = seen.contrast_share(corner.column, corner.row)) shares.push_back(*share);
  if (!shares.empty() && upper_median(std::move(shares)) < kHalf) return false;
  const auto goes_on = [&](bool runs_down, double corner, double outward) {
    const auto border = seen.alternation(runs_down, corner + 0.5 * outward);
    const auto beyond = seen.alternation(runs_down, corner + 1.5 * outward);
    // Squares that go on give -border, a margin of one shade gives 0.
    return border && beyond && -*beyond * (*border > 0 ? 1 : -1) > kHalf * std::abs(*border);
  };
  return !goes_on(false, 0, -1) && !goes_on(false, board.rows - 1, 1) && !goes_on(true, 0, -1) &&
         !goes_on(true, board.columns - 1, 1);
}

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
  if (!board_.markers && !are_all_corners(corners, image, board_)) {
    ++of_other_size_;
    return;
  }
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
