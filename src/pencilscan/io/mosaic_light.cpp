#include "pencilscan/io/mosaic_light.h"

#include <array>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/parallel.h"

namespace pencilscan {
namespace {

/// Rows or columns of the four nearest places that see the same colour, where a place itself sees
/// another one.
using FourNearest = std::array<int, 4>;

/// Of every place of a row or column of `size`, mirrored at its ends: a mirrored place sees the
/// same colour.
std::vector<FourNearest> nearest_four(int size) {
  const int period = 2 * (size - 1);
  const auto inside = [&](int i) {
    i = (i + 2 * period) % period;
    return i < size ? i : period - i;
  };
  std::vector<FourNearest> result;
  for (int i = 0; i < size; ++i)
    result.push_back({inside(i - 3), inside(i - 1), inside(i + 1), inside(i + 3)});
  return result;
}

/// Midway between b and c, on the cubic through four values as far apart each.
float midway(float a, float b, float c, float d) { return (9 * (b + c) - (a + d)) / 16; }

/// Midway between the four nearest of each place's column.
void midway_down(const cv::Mat& image, const FourNearest& rows, std::vector<float>& result) {
  const auto* a = image.ptr<float>(rows[0]);
  const auto* b = image.ptr<float>(rows[1]);
  const auto* c = image.ptr<float>(rows[2]);
  const auto* d = image.ptr<float>(rows[3]);
  for (std::size_t x = 0; x < result.size(); ++x) result[x] = midway(a[x], b[x], c[x], d[x]);
}

}  // namespace

cv::Mat light_behind(const cv::Mat& raw, const Mosaic& mosaic) {
  PENCILSCAN_CHECK(raw.type() == CV_32FC1 && raw.rows >= 2 && raw.cols >= 2);
  const std::vector<FourNearest> rows = nearest_four(raw.rows);
  const std::vector<FourNearest> columns = nearest_four(raw.cols);
  cv::Mat across(raw.size(), CV_32F);
  parallel_for(rows.size(), [&](std::size_t y) {
    const auto* in = raw.ptr<float>(static_cast<int>(y));
    auto* out = across.ptr<float>(static_cast<int>(y));
    for (const auto& [a, b, c, d] : columns) *out++ = midway(in[a], in[b], in[c], in[d]);
  });
  cv::Mat rgb(raw.size(), CV_32FC3);
  parallel_for(rows.size(), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    std::vector<float> down(columns.size());
    std::vector<float> diagonal(columns.size());
    midway_down(raw, rows[row], down);
    midway_down(across, rows[row], diagonal);
    const auto* here = raw.ptr<float>(y);
    const auto* beside_here = across.ptr<float>(y);
    auto* out = rgb.ptr<cv::Vec3f>(y);
    for (int x = 0; x < raw.cols; ++x) {
      const auto at = static_cast<std::size_t>(x);
      const int own = mosaic.color(x, y);
      const int beside = mosaic.color(x + 1, y);
      out[x][own] = here[x];
      if (own == 1) {  // green: one colour beside it, the other one above and below
        out[x][beside] = beside_here[x];
        out[x][2 - beside] = down[at];
      } else {
        out[x][1] = (beside_here[x] + down[at]) / 2;
        out[x][2 - own] = diagonal[at];
      }
    }
  });
  return rgb;
}

}  // namespace pencilscan
