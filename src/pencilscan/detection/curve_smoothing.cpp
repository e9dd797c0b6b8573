#include "pencilscan/detection/curve_smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pencilscan/core/lanes.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr int kReach = 4;  ///< points to either side
constexpr int kWindow = 2 * kReach + 1;

/// First point of the window of point i of n: around it, or the outermost at the ends.
int window_begin(int i, int n) { return std::clamp(i - kReach, 0, std::max(0, n - kWindow)); }

/// Positions or directions of points, each coordinate on its own.
struct Coordinates {
  std::vector<float> x;
  std::vector<float> y;

  explicit Coordinates(std::size_t n) : x(n), y(n) {}
};

/// Sums of the least squares for a0 + a1 t + a2 t^2: of t^k, and of v t^k.
template <class Value>
struct ParabolaSums {
  std::array<Value, 5> t{};
  std::array<Value, 3> v{};

  PENCILSCAN_INLINE void add(const Value& along, const Value& across) {
    const Value square = along * along;
    t[0] += 1.F;
    t[1] += along;
    t[2] += square;
    t[3] += square * along;
    t[4] += square * square;
    v[0] += across;
    v[1] += across * along;
    v[2] += across * square;
  }

  /// a0 and a1 by Cramer's rule, a little drawn to 0.
  PENCILSCAN_INLINE void solve(Value& a0, Value& a1) const {
    constexpr float kRidge = 1e-3F;
    const Value a = t[0] + kRidge;
    const Value d = t[2] + kRidge;
    const Value f = t[4] + kRidge;
    const Value of_00 = d * f - t[3] * t[3];
    const Value of_01 = t[2] * t[3] - t[1] * f;
    const Value of_02 = t[1] * t[3] - t[2] * d;
    const Value of_11 = a * f - t[2] * t[2];
    const Value of_12 = t[1] * t[2] - a * t[3];
    const Value inverse = 1 / (a * of_00 + t[1] * of_01 + t[2] * of_02);
    a0 = (v[0] * of_00 + v[1] * of_01 + v[2] * of_02) * inverse;
    a1 = (v[0] * of_01 + v[1] * of_11 + v[2] * of_12) * inverse;
  }
};

constexpr float kUnit = 0.25F;  ///< of t: keeps its powers near 1

PENCILSCAN_INLINE void normalize(Lanes& x, Lanes& y) {
  const Lanes square = x * x + y * y;
  Lanes length;
  for (int k = 0; k < kLanes; ++k) length[k] = std::sqrt(square[k]);
  // Points on one place have no direction: it stays zero.
  length = length > 0 ? length : length + 1;
  x /= length;
  y /= length;
}

/// Where the windows of eight points begin: one after the other but at the ends of the curve.
struct Window {
  bool is_regular;
  int first;
  IntLanes begin;

  PENCILSCAN_INLINE void load_from(const float* values, int j, Lanes& lanes) const {
    if (is_regular) {
      load(values + first + j, lanes);
    } else {
      gather(values + j, begin, lanes);
    }
  }
};

/// Eight points from `first` on, of n >= kWindow.
PENCILSCAN_CLONES
void smooth_eight(const float* x, const float* y, int n, int first, float* new_x, float* new_y,
                  float* normal_x, float* normal_y) {
  const bool is_inside = first >= kReach && first + kLanes + kReach <= n;
  IntLanes begin;
  for (int k = 0; k < kLanes; ++k) begin[k] = window_begin(first + k, n);
  const Window window{is_inside, first - kReach, begin};
  Lanes center_x;
  Lanes center_y;
  load(x + first, center_x);
  load(y + first, center_y);
  Lanes tx;
  Lanes ty;
  Lanes start;
  window.load_from(x, kWindow - 1, tx);
  window.load_from(x, 0, start);
  tx -= start;
  window.load_from(y, kWindow - 1, ty);
  window.load_from(y, 0, start);
  ty -= start;
  normalize(tx, ty);
  ParabolaSums<Lanes> sums;
  for (int j = 0; j < kWindow; ++j) {
    Lanes dx;
    Lanes dy;
    window.load_from(x, j, dx);
    window.load_from(y, j, dy);
    dx -= center_x;
    dy -= center_y;
    sums.add(kUnit * (dx * tx + dy * ty), dx * ty - dy * tx);
  }
  Lanes offset;
  Lanes slope;
  sums.solve(offset, slope);
  store(center_x + offset * ty, new_x + first);
  store(center_y - offset * tx, new_y + first);
  slope *= kUnit;
  Lanes nx = ty - slope * tx;
  Lanes ny = -tx - slope * ty;
  normalize(nx, ny);
  store(nx, normal_x + first);
  store(ny, normal_y + first);
}

/// The same for one point of a short curve.
void smooth_one(const Coordinates& from, int i, Vector2f& position, Vector2f& normal) {
  const int n = static_cast<int>(from.x.size());
  const auto at = [&](int j) {
    return Vector2f(from.x[static_cast<std::size_t>(j)], from.y[static_cast<std::size_t>(j)]);
  };
  const int reach = std::min(kReach, n / 2);
  const int low = std::clamp(i - reach, 0, std::max(0, n - 1 - 2 * reach));
  const int high = std::min(n - 1, low + 2 * reach);
  const Vector2f tangent = (at(high) - at(low)).normalized();
  const Vector2f across(tangent.y(), -tangent.x());
  ParabolaSums<float> sums;
  for (int j = low; j <= high; ++j) {
    const Vector2f d = at(j) - at(i);
    sums.add(kUnit * d.dot(tangent), d.dot(across));
  }
  float offset = 0;
  float slope = 0;
  sums.solve(offset, slope);
  position = at(i) + offset * across;
  normal = (across - kUnit * slope * tangent).normalized();
}

PENCILSCAN_INLINE void order(Lanes& a, Lanes& b) {
  const Lanes low = a < b ? a : b;
  b = a < b ? b : a;
  a = low;
}

PENCILSCAN_INLINE void order(Lanes& a, Lanes& b, Lanes& c) {
  order(a, b);
  order(b, c);
  order(a, b);
}

/// Medians of the nine values from each of eight places on: with every triple in order, it is the
/// median of the largest first, the middle second and the smallest third values.
PENCILSCAN_CLONES
void median_of_nine(const float* values, float* medians) {
  std::array<Lanes, kWindow> v{};
  for (int j = 0; j < kWindow; ++j) load(values + j, v[static_cast<std::size_t>(j)]);
  for (std::size_t j = 0; j < kWindow; j += 3) order(v[j], v[j + 1], v[j + 2]);
  for (std::size_t j = 0; j < 3; ++j) order(v[j], v[j + 3], v[j + 6]);
  order(v[6], v[4], v[2]);
  store(v[4], medians);
}

}  // namespace

void smooth_positions(std::vector<CurvePoint>& points) {
  const int n = static_cast<int>(points.size());
  Coordinates from(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    from.x[i] = points[i].position.x();
    from.y[i] = points[i].position.y();
  }
  if (n < kWindow) {
    for (int i = 0; i < n; ++i) {
      CurvePoint& p = points[static_cast<std::size_t>(i)];
      smooth_one(from, i, p.position, p.normal);
    }
    return;
  }
  Coordinates to(points.size());
  Coordinates normal(points.size());
  for (int first = 0; first < n; first += kLanes) {
    smooth_eight(from.x.data(), from.y.data(), n, std::min(first, n - kLanes), to.x.data(),
                 to.y.data(), normal.x.data(), normal.y.data());
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].position = {to.x[i], to.y[i]};
    points[i].normal = {normal.x[i], normal.y[i]};
  }
}

void smooth_widths(std::vector<CurvePoint>& points) {
  const int n = static_cast<int>(points.size());
  std::vector<float> widths(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) widths[i] = points[i].width_px;
  std::vector<float> medians(points.size());
  const int last_inside = n - kReach - kLanes;  // of eight
  for (int i = kReach; i < n - kReach && last_inside >= kReach; i += kLanes) {
    const int first = std::min(i, last_inside);
    median_of_nine(widths.data() + first - kReach, medians.data() + first);
  }
  for (int i = 0; i < n; ++i) {
    const bool is_inside = i >= kReach && i < n - kReach && last_inside >= kReach;
    if (is_inside) continue;
    std::array<float, kWindow> window{};
    const auto begin = widths.begin() + std::max(0, i - kReach);
    const auto end = widths.begin() + std::min(n, i + kReach + 1);
    std::copy(begin, end, window.begin());
    const auto middle = window.begin() + (end - begin) / 2;
    std::nth_element(window.begin(), middle, window.begin() + (end - begin));
    medians[static_cast<std::size_t>(i)] = *middle;
  }
  for (std::size_t i = 0; i < points.size(); ++i) points[i].width_px = medians[i];
}

}  // namespace pencilscan
