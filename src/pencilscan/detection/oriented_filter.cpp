#include "pencilscan/detection/oriented_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

namespace pencilscan {
namespace {

FilterDirection make_direction(double theta, double sigma) {
  FilterDirection direction{
      static_cast<float>(std::cos(theta)), static_cast<float>(std::sin(theta)), {}};
  const double tx = -std::sin(theta);
  const double ty = std::cos(theta);
  const bool major_x = std::abs(tx) > std::abs(ty);
  const double slope = major_x ? ty / tx : tx / ty;
  const double step = std::hypot(1, slope);
  const int stride = sigma > 2 ? 2 : 1;  // of a long Gaussian every second tap is enough
  const int reach = stride * static_cast<int>(std::ceil(2.5 * sigma / step / stride));
  double sum = 0;
  for (int j = -reach; j <= reach; j += stride)
    sum += std::exp(-0.5 * std::pow(j * step / sigma, 2));
  for (int j = -reach; j <= reach; j += stride) {
    const double weight = std::exp(-0.5 * std::pow(j * step / sigma, 2)) / sum;
    const double minor = j * slope;
    const int low = static_cast<int>(std::floor(minor));
    const double fraction = minor - low;
    for (int k = 0; k < 2; ++k) {
      const double w = weight * (k == 0 ? 1 - fraction : fraction);
      if (w < 1e-6) continue;
      const int m = low + k;
      direction.taps.push_back({major_x ? j : m, major_x ? m : j, static_cast<float>(w)});
    }
  }
  return direction;
}

/// Negative second derivative along the normal, on `rows` rows of `columns` px from (x, y) on.
PENCILSCAN_CLONES
void steer(const Hessian& h, const FilterDirection& direction, int x, int y, int rows, int columns,
           float* out) {
  const float a = -direction.nx * direction.nx;
  const float b = -2 * direction.nx * direction.ny;
  const float c = -direction.ny * direction.ny;
  for (int r = 0; r < rows; ++r, out += columns) {
    const float* xx = h.xx.ptr<float>(y + r) + x;
    const float* xy = h.xy.ptr<float>(y + r) + x;
    const float* yy = h.yy.ptr<float>(y + r) + x;
    for (int i = 0; i < columns; i += kLanes) {
      Lanes lxx;
      Lanes lxy;
      Lanes lyy;
      load(xx + i, lxx);
      load(xy + i, lxy);
      load(yy + i, lyy);
      store(a * lxx + b * lxy + c * lyy, out + i);
    }
  }
}

/// Weighted sum of the taps for `rows` rows of kBlocks lanes.
template <std::size_t kBlocks>
PENCILSCAN_INLINE void smooth_rows(const FilterDirection::Tap* taps, std::size_t count,
                                   const float* in, int in_row, int rows, float* out) {
  for (int r = 0; r < rows; ++r) {
    std::array<Lanes, kBlocks> sum{};
    for (std::size_t t = 0; t < count; ++t) {
      const float* from = in + (r + taps[t].dy) * in_row + taps[t].dx;
      for (std::size_t block = 0; block < kBlocks; ++block) {
        Lanes value;
        load(from + block * kLanes, value);
        sum[block] += taps[t].weight * value;
      }
    }
    std::memcpy(out, sum.data(), sizeof(sum));
    out += kBlocks * kLanes;
  }
}

constexpr std::size_t kBlocksPerRow = (FilterTile::kTile + 2 + kLanes - 1) / kLanes;

PENCILSCAN_CLONES
void smooth(const FilterDirection::Tap* taps, std::size_t count, const float* in, int in_row,
            int rows, float* out) {
  smooth_rows<kBlocksPerRow>(taps, count, in, in_row, rows, out);
}

/// Bilinear sample at a constant offset: four taps.
struct Neighbor {
  std::ptrdiff_t first = 0;
  float fx = 0;
  float fy = 0;

  Neighbor(float dx, float dy, int row)
      : first(static_cast<std::ptrdiff_t>(std::floor(dy)) * row +
              static_cast<std::ptrdiff_t>(std::floor(dx))),
        fx(dx - std::floor(dx)),
        fy(dy - std::floor(dy)) {}

  PENCILSCAN_INLINE void sample(const float* at, int row, Lanes& value) const {
    Lanes a;
    Lanes b;
    Lanes c;
    Lanes d;
    load(at + first, a);
    load(at + first + 1, b);
    load(at + first + row, c);
    load(at + first + row + 1, d);
    value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
  }
};

struct Planes {
  const float* first;
  std::size_t size;
  int row;
};

/// Maxima among eight pixels from (x, y) on of direction k of n.
PENCILSCAN_CLONES
void maxima_of_eight(const Planes& planes, const FilterDirection* directions, std::size_t n, int x,
                     int y, int width, float threshold, std::vector<FilterMaximum>& maxima) {
  const float* start = planes.first + y * planes.row + x;
  Lanes before;
  Lanes at;
  Lanes after;
  load(start + (n - 1) * planes.size, before);
  load(start, at);
  for (std::size_t k = 0; k < n; ++k) {
    load(start + (k + 1 < n ? k + 1 : 0) * planes.size, after);
    IntLanes is_maximum = (at >= threshold) & (at >= before) & (at > after);
    if (any(is_maximum)) {
      const float nx = directions[k].nx;
      const float ny = directions[k].ny;
      Lanes low;
      Lanes high;
      Neighbor(-nx, -ny, planes.row).sample(start + k * planes.size, planes.row, low);
      Neighbor(nx, ny, planes.row).sample(start + k * planes.size, planes.row, high);
      is_maximum &= (at >= low) & (at > high);
      if (any(is_maximum)) {
        for (int i = 0; i < std::min(kLanes, width - x); ++i) {
          if (is_maximum[i] == 0) continue;
          maxima.push_back(
              {x + i, y, static_cast<int>(k), before[i], at[i], after[i], low[i], high[i]});
        }
      }
    }
    before = at;
    at = after;
  }
}

PENCILSCAN_CLONES
float lowest_of_rows(const float* first, std::ptrdiff_t row, int columns, int rows) {
  Lanes lanes{};
  lanes += *first;
  float low = *first;
  for (int r = 0; r < rows; ++r) {
    const float* from = first + r * row;
    int i = 0;
    for (; i + kLanes <= columns; i += kLanes) {
      Lanes value;
      load(from + i, value);
      lanes = value < lanes ? value : lanes;
    }
    for (; i < columns; ++i) low = std::min(low, from[i]);
  }
  for (int i = 0; i < kLanes; ++i) low = std::min(low, lanes[i]);
  return low;
}

}  // namespace

std::vector<FilterDirection> filter_directions(int count, double sigma_px) {
  std::vector<FilterDirection> directions;
  for (int k = 0; k < count; ++k)
    directions.push_back(make_direction(std::numbers::pi * k / count, sigma_px));
  return directions;
}

int filter_reach(const std::vector<FilterDirection>& directions) {
  int reach = 0;
  for (const FilterDirection& d : directions) {
    for (const auto& tap : d.taps) reach = std::max({reach, std::abs(tap.dx), std::abs(tap.dy)});
  }
  return reach;
}

FilterTile::FilterTile(const std::vector<FilterDirection>& directions)
    : directions_(directions),
      reach_(filter_reach(directions)),
      steered_row_((kSize + 2 * reach_ + kLanes - 1) / kLanes * kLanes),
      responses_(directions.size() * kPlane + kLanes, 0.F),
      steered_(static_cast<std::size_t>(steered_row_ * (kSize + 2 * reach_) + kLanes), 0.F) {
  static_assert(kBlocksPerRow * kLanes == kRow);
}

void FilterTile::compute(const Hessian& h, int x0, int y0) {
  const int side = kSize + 2 * reach_;
  for (std::size_t k = 0; k < directions_.size(); ++k) {
    const FilterDirection& d = directions_[k];
    steer(h, d, x0 - 1 - reach_, y0 - 1 - reach_, side, steered_row_, steered_.data());
    smooth(d.taps.data(), d.taps.size(), steered_.data() + reach_ * steered_row_ + reach_,
           steered_row_, kSize, responses_.data() + k * kPlane);
  }
}

void FilterTile::find_maxima(float threshold, int width, int height,
                             std::vector<FilterMaximum>& maxima) const {
  maxima.clear();
  const Planes planes{responses_.data(), kPlane, kRow};
  for (int y = 1; y <= height; ++y) {
    for (int x = 1; x <= width; x += kLanes) {
      maxima_of_eight(planes, directions_.data(), directions_.size(), x, y, width + 1, threshold,
                      maxima);
    }
  }
  for (FilterMaximum& m : maxima) {
    --m.x;
    --m.y;
  }
}

float lowest_value(const cv::Mat& image, const cv::Rect& area) {
  return lowest_of_rows(image.ptr<float>(area.y) + area.x,
                        static_cast<std::ptrdiff_t>(image.step1()), area.width, area.height);
}

}  // namespace pencilscan
