#include "pencilscan/detection/mosaic_trace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "pencilscan/core/check.h"
#include "pencilscan/core/lanes.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

/// Differences at some places of a 2 x 2 mosaic.
struct PhaseSum {
  double sum = 0;
  double squares = 0;
  double count = 0;

  void add(float difference) {
    const auto d = static_cast<double>(difference);
    sum += d;
    squares += d * d;
    count += 1;
  }

  [[nodiscard]] double mean() const { return sum / count; }
  /// Standard deviation of the mean.
  [[nodiscard]] double error() const {
    return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count);
  }
};

constexpr std::size_t kChannels = 3;
/// Values of a row after which columns' phases and channels repeat, in whole registers.
constexpr std::size_t kPeriod = 2 * kChannels * kLanes / 2;

/// Sums over a row, of places `kPeriod` values apart.
struct RowSums {
  std::array<float, kPeriod> sum;
  std::array<float, kPeriod> squares;
};

/// |value - mean of its four neighbours| of `periods` times kPeriod values from `here` on.
PENCILSCAN_CLONES
void sum_row(const float* above, const float* here, const float* below, std::size_t periods,
             RowSums& sums) {
  constexpr std::size_t kBlocks = kPeriod / kLanes;
  std::array<Lanes, kBlocks> sum{};
  std::array<Lanes, kBlocks> squares{};
  for (std::size_t first = 0; first < periods * kPeriod; first += kPeriod) {
    for (std::size_t block = 0; block < kBlocks; ++block) {
      const std::size_t i = first + block * kLanes;
      Lanes value;
      Lanes left;
      Lanes right;
      Lanes up;
      Lanes down;
      load(here + i, value);
      load(here + i - kChannels, left);
      load(here + i + kChannels, right);
      load(above + i, up);
      load(below + i, down);
      const Lanes apart = value - 0.25F * (left + right + up + down);
      sum[block] += apart < 0 ? -apart : apart;
      squares[block] += apart * apart;
    }
  }
  for (std::size_t block = 0; block < kBlocks; ++block) {
    store(sum[block], sums.sum.data() + block * kLanes);
    store(squares[block], sums.squares.data() + block * kLanes);
  }
}

/// |value - mean of its four neighbours|, per channel. A few columns at the right edge are left
/// out.
std::array<std::array<PhaseSum, 4>, kChannels> phase_sums(const cv::Mat& rgb) {
  std::array<std::array<PhaseSum, 4>, kChannels> phases;
  const std::size_t periods = kChannels * static_cast<std::size_t>(rgb.cols - 2) / kPeriod;
  RowSums sums{};
  // In all rows: of some, lines of other spacings look like these places.
  for (int y = 1; y + 1 < rgb.rows; ++y) {
    sum_row(rgb.ptr<float>(y - 1) + kChannels, rgb.ptr<float>(y) + kChannels,
            rgb.ptr<float>(y + 1) + kChannels, periods, sums);
    for (std::size_t i = 0; i < kPeriod; ++i) {
      const std::size_t column = 1 + i / kChannels;
      PhaseSum& phase = phases[i % kChannels][static_cast<std::size_t>(2 * (y % 2)) + column % 2];
      phase.sum += static_cast<double>(sums.sum[i]);
      phase.squares += static_cast<double>(sums.squares[i]);
      phase.count += static_cast<double>(periods);
    }
  }
  return phases;
}

/// How many standard deviations the two rows of a mosaic's places, its two columns, and its two
/// diagonals are apart.
std::array<double, 3> contrast_deviations(const std::array<PhaseSum, 4>& phases) {
  double variance = 0;
  for (const PhaseSum& phase : phases) variance += phase.error() * phase.error();
  if (!(variance > 0)) return {};
  const auto apart = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    const double sum = phases[a].mean() + phases[b].mean() - phases[c].mean() - phases[d].mean();
    return std::abs(sum) / std::sqrt(variance);
  };
  return {apart(0, 1, 2, 3), apart(0, 2, 1, 3), apart(0, 3, 1, 2)};
}

enum class Interpolation { kNearest, kGradientCorrected };

constexpr int kFilterReach = 2;  // px, of the interpolations

/// Linear light of some rows of a picture (CV_32FC3), and the mosaic's samples in it.
class Samples {
 public:
  Samples(const cv::Mat& light, const Mosaic& mosaic) : light_(light), mosaic_(mosaic) {}

  [[nodiscard]] int color(int x, int y) const { return mosaic_.color(x, y); }
  [[nodiscard]] float value(int x, int y, int color) const {
    return light_.at<cv::Vec3f>(y, x)[color];
  }
  [[nodiscard]] float at(int x, int y) const { return value(x, y, color(x, y)); }
  /// The means of two samples on both sides, of four around, and of the four on the diagonals.
  [[nodiscard]] float pair(int x, int y, int dx, int dy) const {
    return (at(x - dx, y - dy) + at(x + dx, y + dy)) / 2;
  }
  [[nodiscard]] float cross(int x, int y, int step) const {
    return (pair(x, y, step, 0) + pair(x, y, 0, step)) / 2;
  }
  [[nodiscard]] float corners(int x, int y) const {
    return (pair(x, y, 1, 1) + pair(x, y, 1, -1)) / 2;
  }

 private:
  const cv::Mat& light_;
  const Mosaic& mosaic_;
};

/// Where the samples of a colour lie that a pixel does not have.
struct Neighbors {
  bool beside = false;
  bool below = false;
};

Neighbors neighbors(const Samples& s, int x, int y, int color) {
  return {s.color(x + 1, y) == color, s.color(x, y + 1) == color};
}

/// Least and greatest of the nearest samples of a colour.
std::pair<float, float> range(const Samples& s, int x, int y, const Neighbors& at) {
  std::pair<float, float> range(1e9F, -1e9F);
  const auto add = [&](int dx, int dy) {
    for (const int side : {-1, 1}) {
      const float sample = s.at(x + side * dx, y + side * dy);
      range = {std::min(range.first, sample), std::max(range.second, sample)};
    }
  };
  if (at.beside) add(1, 0);
  if (at.below) add(0, 1);
  if (at.beside || at.below) return range;
  add(1, 1);
  add(1, -1);
  return range;
}

/// How far the colour of a pixel is from what an interpolation makes of the samples around it.
float apart(const Samples& s, Interpolation how, int x, int y, int color, const Neighbors& at) {
  const auto off = [&](float made) {
    return std::abs(std::clamp(made, 0.F, 1.F) - s.value(x, y, color));
  };
  if (how == Interpolation::kNearest) {
    if (at.beside && at.below)
      return std::min({off(s.pair(x, y, 1, 0)), off(s.pair(x, y, 0, 1)), off(s.cross(x, y, 1))});
    if (at.beside) return off(s.pair(x, y, 1, 0));
    return off(at.below ? s.pair(x, y, 0, 1) : s.corners(x, y));
  }
  const float here = s.at(x, y);
  if (at.beside && at.below) return off(s.cross(x, y, 1) + 0.5F * (here - s.cross(x, y, 2)));
  if (!at.beside && !at.below) return off(s.corners(x, y) + 0.75F * (here - s.cross(x, y, 2)));
  const int dx = at.beside ? 1 : 0;
  const int dy = 1 - dx;
  return off(s.pair(x, y, dx, dy) + 0.625F * here - 0.5F * s.corners(x, y) -
             0.25F * s.pair(x, y, 2 * dx, 2 * dy) + 0.125F * s.pair(x, y, 2 * dy, 2 * dx));
}

/// A mosaic and what may have filled in its colours.
class Candidate {
 public:
  static constexpr float kContrast = 8;  ///< tolerances: of samples that tell

  Candidate(const Mosaic& mosaic, Interpolation how) : mosaic_(mosaic), how_(how) {}

  /// Looks at the two rows in the middle of `light`. `tolerance`: in values, of a brightest light.
  template <class Tolerance>
  void look(const cv::Mat& light, Tolerance tolerance) {
    const Samples samples(light, mosaic_);
    for (int y = kFilterReach; y < light.rows - kFilterReach; ++y) {
      for (int x = kFilterReach; x < light.cols - kFilterReach && !is_out(); ++x) {
        for (int color = 0; color < 3; ++color) {
          if (samples.color(x, y) == color) continue;
          const Neighbors at = neighbors(samples, x, y, color);
          const auto [least, most] = range(samples, x, y, at);
          const float allowed = tolerance(std::max(most, samples.at(x, y)));
          if (most - least < kContrast * allowed) continue;
          ++telling_;
          if (apart(samples, how_, x, y, color, at) <= allowed) ++agreeing_;
        }
      }
    }
  }

  [[nodiscard]] const Mosaic& mosaic() const { return mosaic_; }
  [[nodiscard]] bool is_out() const { return telling_ >= 200 && agreeing_ < 0.9 * telling_; }
  [[nodiscard]] bool is_it() const { return telling_ >= 1000 && agreeing_ >= 0.99 * telling_; }

 private:
  Mosaic mosaic_;
  Interpolation how_;
  double telling_ = 0;
  double agreeing_ = 0;
};

}  // namespace

bool looks_interpolated(const cv::Mat& rgb) {
  PENCILSCAN_CHECK(rgb.type() == CV_32FC3);
  // Of 703 pictures of three channels, a half of them through JPEG, none has a second contrast of
  // more than 2. Of those filled in behind a mosaic and stored with a gamma of 2.2, as JPEG of
  // quality 80 and 92 too, all have one of more than 5.
  constexpr double kDeviations = 4;
  if (rgb.rows < 16 || rgb.cols < 16) return false;
  std::array<double, 3> contrasts{};
  const auto sums = phase_sums(rgb);
  for (const std::size_t channel : {0U, 2U}) {  // a quarter of the samples each
    const std::array<double, 3> of_channel = contrast_deviations(sums[channel]);
    for (std::size_t i = 0; i < contrasts.size(); ++i)
      contrasts[i] = std::max(contrasts[i], of_channel[i]);
  }
  std::sort(contrasts.begin(), contrasts.end());
  return contrasts[1] > kDeviations;
}

Greens greens_of(const Mosaic& mosaic) {
  constexpr int kGreen = 1;
  return mosaic.color(1, 0) == kGreen ? Greens::kOdd : Greens::kEven;
}

Greens greens_of(const cv::Mat& samples) {
  PENCILSCAN_CHECK(samples.channels() == 1);
  // Of 20 raw pictures, down to 480 x 360, 17 are told; blocks of 32 px are too few there, and
  // tell 8. Of 918 pictures whose colours were made grey none is taken for a mosaic: their shares
  // are .7 and more.
  constexpr int kBlock = 16;
  constexpr double kMostShare = 0.6;  // of the difference of the other diagonal
  constexpr double kDeviations = 4;
  double odd = 0;   // sum of the differences of the two places with x + y odd, ...
  double even = 0;  // ... and even
  PhaseSum apart;   // of these two
  for (int y = 0; y + kBlock <= samples.rows; y += kBlock) {
    const cv::Mat rows = unit_values(samples.rowRange(y, y + kBlock));
    for (int x = 0; x + kBlock <= rows.cols; x += kBlock) {
      std::array<float, 4> sums{};
      for (int v = 0; v < kBlock; ++v) {
        const float* row = rows.ptr<float>(v) + x;
        float* of_row = sums.data() + static_cast<std::size_t>(2 * (v % 2));
        for (int u = 0; u < kBlock; u += 2) {
          of_row[0] += row[u];
          of_row[1] += row[u + 1];
        }
      }
      const float of_odd = std::abs(sums[1] - sums[2]);
      const float of_even = std::abs(sums[0] - sums[3]);
      odd += static_cast<double>(of_odd);
      even += static_cast<double>(of_even);
      apart.add(of_even - of_odd);
    }
  }
  if (apart.count == 0 || std::min(odd, even) > kMostShare * std::max(odd, even) ||
      std::abs(apart.mean()) < kDeviations * apart.error())
    return Greens::kNone;
  return odd < even ? Greens::kOdd : Greens::kEven;
}

std::optional<Mosaic> mosaic_behind(const Camera& camera, const cv::Mat& stored) {
  PENCILSCAN_CHECK(stored.channels() == 3);
  constexpr int kRows = 2;   // looked at together: all places of a mosaic
  constexpr int kEvery = 8;  // of so many rows
  // Samples are rounded, and what is made of them once or twice: 1.5 steps at most were measured.
  const double rounding = 2.0 / (stored.depth() == CV_16U ? 4095 : 255);
  const auto tolerance = [&](float light) {
    const double slope = std::pow(static_cast<double>(std::max(light, 0.F)), 1 - 1 / camera.gamma);
    return static_cast<float>(rounding * camera.gamma * slope / (1 - camera.black_level));
  };
  std::vector<Candidate> candidates;
  for (const char* name : {"RGGB", "BGGR", "GRBG", "GBRG"}) {
    for (const Interpolation how : {Interpolation::kNearest, Interpolation::kGradientCorrected})
      candidates.emplace_back(*Mosaic::from_name(name), how);
  }
  for (int y = kFilterReach; y + kRows + kFilterReach <= stored.rows; y += kEvery) {
    const cv::Mat rows = stored.rowRange(y - kFilterReach, y + kRows + kFilterReach);
    const cv::Mat light = linearized(camera_values(camera, rows), camera.gamma, camera.black_level);
    double darkest = 0;
    double brightest = 0;
    cv::minMaxIdx(light.reshape(1), &darkest, &brightest);
    if (brightest - darkest < Candidate::kContrast * tolerance(0)) continue;  // dark: nothing tells
    for (Candidate& candidate : candidates) candidate.look(light, tolerance);
    std::erase_if(candidates, [](const Candidate& candidate) { return candidate.is_out(); });
    if (candidates.empty()) return std::nullopt;
  }
  // A picture without noise may be so smooth that every mosaic fills it in.
  const bool is_known = candidates.size() == 1 && candidates.front().is_it();
  return is_known ? std::optional(candidates.front().mosaic()) : std::nullopt;
}

}  // namespace pencilscan
