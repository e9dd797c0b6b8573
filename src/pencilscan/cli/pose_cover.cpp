#include "pencilscan/cli/pose_cover.h"

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace pencilscan::cli {
namespace {

const cv::Size kCoverCells(4, 3);  ///< of a camera's picture
constexpr double kCovered = 0.5;   ///< of a cell

}  // namespace

PoseCover::PoseCover(const std::vector<Camera>& cameras) : lit_(cameras.size()) {
  for (const Camera& camera : cameras) cameras_.push_back(camera.name);
}

void PoseCover::add(const std::vector<std::vector<LitView>>& views) {
  for (const auto& of_projector : views) {
    for (std::size_t c = 0; c < of_projector.size(); ++c) {
      const cv::Mat& lit = of_projector[c].lit;
      if (!lit.empty()) lit_[c] = lit_[c].empty() ? lit.clone() : cv::Mat(lit_[c] | lit);
    }
  }
}

cv::Mat PoseCover::cells(std::size_t camera) const {
  cv::Mat cells;
  lit_[camera].convertTo(cells, CV_32F, 1.0 / 255);
  cv::resize(cells, cells, kCoverCells, 0, 0, cv::INTER_AREA);
  return cells;
}

nlohmann::ordered_json PoseCover::json() const {
  auto all = nlohmann::ordered_json::array();
  for (std::size_t c = 0; c < lit_.size(); ++c) {
    if (lit_[c].empty()) continue;
    const cv::Mat shares = cells(c);
    auto rows = nlohmann::ordered_json::array();
    for (int y = 0; y < shares.rows; ++y)
      rows.push_back(std::vector<float>(shares.ptr<float>(y), shares.ptr<float>(y) + shares.cols));
    all.push_back({{"camera", cameras_[c]},
                   {"share", cv::mean(lit_[c])[0] / 255},
                   {"rows", std::move(rows)}});
  }
  return all;
}

std::string PoseCover::emptiest_cell() const {
  static const char* const kAcross[] = {"left", "left of the middle", "right of the middle",
                                        "right"};
  static const char* const kDown[] = {"at the top", "in the middle", "at the bottom"};
  double least = kCovered;
  std::string where;
  for (std::size_t c = 0; c < lit_.size(); ++c) {
    if (lit_[c].empty()) continue;
    const cv::Mat shares = cells(c);
    for (int y = 0; y < shares.rows; ++y) {
      for (int x = 0; x < shares.cols; ++x) {
        if (shares.at<float>(y, x) >= least) continue;
        least = shares.at<float>(y, x);
        where = cameras_[c] + " has seen least " + kDown[y] + ", " + kAcross[x];
      }
    }
  }
  return where;
}

}  // namespace pencilscan::cli
