#include "pencilscan/detection/ridge_scales.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "pencilscan/detection/trace.h"
#include "pencilscan/view/cell_index.h"
#include "pencilscan/view/nearest.h"

namespace pencilscan {
namespace {

// Lengths in pixels of the next finer image, in which the line is 4 to 9 wide.
constexpr float kSameLine = 1.3F;   ///< a finer ridgel this near to the middle is the line itself
constexpr float kLineReach = 5.5F;  ///< half the width of the widest line, and its edges' ridgels
constexpr float kAlong = 2;
/// Beyond the end of a line the filter's answer falls like the Gaussian that smooths along it: to
/// 5 % after 1.64 of its scale of 3, which are 5 px of the coarser image.
constexpr float kBeyondEnd = 10;
constexpr float kParallelCosine = 0.94F;
/// A wide line is about as bright in its middle as at its edges; between two lines it is dark.
constexpr float kFlatTop = 0.88F;
/// Of the height of a line that is 1.7 to 2.4 s wide, the filter answers .28 (2 a phi(a) / s^2, a
/// half the width in s = 1.3 px; of wider ones less). Chosen: half of the height that this tells
/// of.
constexpr float kHeightPerResponse = 0.5F / 0.28F;
/// Of the contrast: a finer ridgel that is weaker is noise. Where two neighbouring sizes show a
/// line equally well, the finer one has .7 of the coarser one's contrast; three sizes apart a
/// third.
constexpr float kNoiseShare = 0.25F;
/// Of the lines' length. Scenes of lines up to 4 px wide have .001 to .06, a cube whose sides are
/// seen almost edge-on .22; lines of 6 px and more, or some of them, .25 to .94 (docs/sensors.md).
constexpr float kWidePicture = 0.25F;
constexpr std::ptrdiff_t kVoters = 4;  ///< ridgels before and after

/// s^(2 gamma) L(s) with gamma = 3/4, but for a common factor. The full image shows most detail,
/// and its two answers to a line of 3.3 to 3.6 s (4.7 px) lie within kSameLine: it wins up to
/// there.
float strength(const Ridgel& r) {
  constexpr float kFullSizeGain = 1.2F;
  return r.scale > 1 ? r.response / std::sqrt(r.scale) : kFullSizeGain * r.response;
}

float value_at(const cv::Mat& image, float scale, const Ridgel& r) {
  const int ix = std::clamp(nearest(r.x / scale), 0, image.cols - 1);
  const int iy = std::clamp(nearest(r.y / scale), 0, image.rows - 1);
  return image.at<float>(iy, ix);
}

bool are_parallel(const Ridgel& f, const Ridgel& wide) {
  return std::abs(f.nx * wide.nx + f.ny * wide.ny) >= kParallelCosine;
}

/// Of a finer ridgel from a wide one's line, and along that line.
struct RidgelDistance {
  float across, along;
};
RidgelDistance distance(const Ridgel& f, const Ridgel& w) {
  return {std::abs((f.x - w.x) * w.nx + (f.y - w.y) * w.ny),
          std::abs(-(f.x - w.x) * w.ny + (f.y - w.y) * w.nx)};
}

/// What finer looks found around wide ridgels.
class FinerLook {
 public:
  FinerLook(const std::vector<Ridgel>& finer, const cv::Mat& image, float unit, cv::Size full_size)
      : finer_(finer),
        image_(image),
        unit_(unit),
        index_(full_size, static_cast<int>(4 * unit), finer.size(),
               [&](std::size_t i) { return std::pair(finer[i].x, finer[i].y); }),
        is_spent_(finer.size(), 0) {}

  /// Whether the ridgel is the middle of a line that the finer looks show less well.
  [[nodiscard]] bool is_best(const Ridgel& wide) const {
    const float middle = value_at(image_, unit_, wide);
    bool result = true;
    around(wide, kBeyondEnd, [&](const Ridgel& f, std::size_t, float across, float along) {
      if (is_noise(f, wide)) return true;
      // The edges of a wide line have half its contrast. What has more is a line of its own, and
      // this one what the coarser filter sees of it, or of its end; but a line that has light here
      // goes on, wider and dimmer.
      const bool is_parallel = are_parallel(f, wide);
      const bool is_beside = along <= kAlong * unit_;
      if (is_parallel && f.response >= wide.response && (is_beside || !has_light(wide, middle)))
        return result = false;
      if (!is_beside) return true;
      const bool is_near = across < kSameLine * unit_;
      if (is_parallel) {
        result = (!is_near || strength(f) < strength(wide)) &&
                 middle >= kFlatTop * value_at(image_, unit_, f);
      } else {
        // Lines that run across it and are stronger: it is the shape that they lie on. At half the
        // size the filter reaches no farther than one of them.
        result = !is_near || wide.scale <= 2 || f.response < wide.response;
      }
      return result;
    });
    return result;
  }

  /// Marks what the line at the ridgel explains.
  void spend(const Ridgel& wide) {
    around(wide, kAlong, [&](const Ridgel& f, std::size_t i, float, float) {
      const bool is_part = are_parallel(f, wide) && f.response < wide.response;
      // At half the size a weak line that crosses is as likely as noise.
      if (is_part || (wide.scale > 2 && is_noise(f, wide))) is_spent_[i] = 1;
      return true;
    });
  }

  [[nodiscard]] bool is_spent(std::size_t i) const { return is_spent_[i] != 0; }

 private:
  /// Whether the light at a wide ridgel, `middle`, exceeds that beside its line as its response
  /// says. Beyond the end of a line there is none.
  [[nodiscard]] bool has_light(const Ridgel& wide, float middle) const {
    float beside = 0;
    for (const float side : {-kLineReach, kLineReach}) {
      Ridgel at = wide;
      at.x += side * unit_ * wide.nx;
      at.y += side * unit_ * wide.ny;
      beside += 0.5F * value_at(image_, unit_, at);
    }
    return middle - beside >= kHeightPerResponse * wide.response;
  }

  static bool is_noise(const Ridgel& f, const Ridgel& wide) {
    return f.response < kNoiseShare * wide.response;
  }

  /// visit(finer ridgel, its index, distance across, along) until it gives false.
  template <class Visit>
  void around(const Ridgel& w, float reach_along, Visit visit) const {
    index_.around(w.x, w.y, unit_ * std::hypot(kLineReach, reach_along), [&](int item) {
      const auto i = static_cast<std::size_t>(item);
      const Ridgel& f = finer_[i];
      const auto [across, along] = distance(f, w);
      if (across > kLineReach * unit_ || along > reach_along * unit_) return true;
      return visit(f, i, across, along);
    });
  }

  const std::vector<Ridgel>& finer_;
  const cv::Mat& image_;
  float unit_;
  CellIndex index_;
  std::vector<char> is_spent_;
};

/// 1 where most of the votes around say so; a chain's ends have fewer voters.
std::vector<char> majority(const std::vector<char>& votes) {
  const auto n = static_cast<std::ptrdiff_t>(votes.size());
  std::vector<char> result(votes.size());
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const auto first = votes.begin() + std::max<std::ptrdiff_t>(0, i - kVoters);
    const auto last = votes.begin() + std::min(n, i + kVoters + 1);
    result[static_cast<std::size_t>(i)] = 2 * std::count(first, last, 1) > last - first ? 1 : 0;
  }
  return result;
}

/// Adds the ridgels of an image of 1 / scale of the full size to those of finer ones where it shows
/// the line best, and removes what the finer looks took for lines within it: its two edges, and
/// noise. All in pixels of the full image; `finer_image` has twice the size.
///
/// Where two sizes show a line about equally well, noise would choose now one, now the other: most
/// of the ridgels before and after on the line decide. `is_usual`: every line that it shows is one.
void add_wider(const std::vector<Ridgel>& wide, const cv::Mat& finer_image, cv::Size full_size,
               bool is_usual, std::vector<Ridgel>& ridgels) {
  if (wide.empty()) return;
  FinerLook finer(ridgels, finer_image, 0.5F * wide.front().scale, full_size);
  std::vector<Ridgel> result;
  std::vector<char> votes;
  for (const std::vector<std::size_t>& chain : link_ridgels(wide, full_size)) {
    votes.clear();
    for (const std::size_t i : chain) votes.push_back(is_usual || finer.is_best(wide[i]) ? 1 : 0);
    const std::vector<char> elected = majority(votes);
    for (std::size_t k = 0; k < chain.size(); ++k) {
      if (elected[k] == 0) continue;
      finer.spend(wide[chain[k]]);
      result.push_back(wide[chain[k]]);
    }
  }
  for (std::size_t i = 0; i < ridgels.size(); ++i) {
    if (!finer.is_spent(i)) result.push_back(ridgels[i]);
  }
  ridgels = std::move(result);
}

/// Adds the ridgels of wide lines and removes the edges that the finer look took for lines.
std::vector<Ridgel> merged_scales(const cv::Mat& presence, const std::vector<Ridgel>& fine,
                                  const std::vector<Ridgel>& wide) {
  constexpr float kWideLinePx = 2.6F;
  constexpr int kCellPx = 4;
  const CellIndex index(presence.size(), kCellPx, fine.size(),
                        [&](std::size_t i) { return std::pair(fine[i].x, fine[i].y); });
  std::vector<Ridgel> by_cell;  // what lies together, together in memory
  by_cell.reserve(fine.size());
  for (const int item : index.items()) by_cell.push_back(fine[static_cast<std::size_t>(item)]);
  std::vector<char> is_edge(fine.size(), 0);
  std::vector<Ridgel> result;
  std::vector<std::size_t> beside;  // in by_cell
  for (const Ridgel& w : wide) {
    bool is_middle = true;
    beside.clear();
    const auto look = [&](float radius, float max_across) {
      index.ranges(w.x, w.y, radius, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end && is_middle; ++i) {
          const Ridgel& f = by_cell[i];
          const auto [across, along] = distance(f, w);
          if (across > max_across || along > kAlong || !are_parallel(f, w)) continue;
          if (across < kSameLine) is_middle = false;
          beside.push_back(i);
        }
        return is_middle;
      });
    };
    look(std::hypot(kSameLine, kAlong), kSameLine);  // mostly, this is a fine line too
    if (!is_middle) continue;
    beside.clear();
    look(kLineReach, kLineReach);
    const float middle = value_at(presence, 1, w);
    for (const std::size_t i : beside) {
      is_middle = is_middle && middle >= kFlatTop * value_at(presence, 1, by_cell[i]);
    }
    if (!is_middle) continue;
    for (const std::size_t i : beside) is_edge[static_cast<std::size_t>(index.items()[i])] = 1;
    result.push_back(w);
    result.back().width_px = kWideLinePx;
  }
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (is_edge[i] == 0) result.push_back(fine[i]);
  }
  return result;
}

/// Ridgels of the half-size image in full-size pixels: two for each, so that they stay about one
/// pixel apart along the line.
std::vector<Ridgel> enlarged(const std::vector<Ridgel>& half_size) {
  std::vector<Ridgel> result;
  result.reserve(2 * half_size.size());
  for (const Ridgel& r : half_size) {
    for (const float along : {-0.5F, 0.5F}) {
      Ridgel twice = r;
      twice.x = 2 * r.x - along * r.ny;
      twice.y = 2 * r.y + along * r.nx;
      result.push_back(twice);
    }
  }
  return result;
}

/// Ridgels of the image at 1 / scale of its size, in pixels of the full one.
std::vector<Ridgel> at_full_size(std::vector<Ridgel> ridgels, float scale, float weakest) {
  // A line that an image shows best is 4 px wide there; halving an image blurs.
  constexpr float kFirstWidthPx = 1.3F;
  std::erase_if(ridgels, [&](const Ridgel& r) { return r.response < weakest; });
  for (Ridgel& r : ridgels) {
    r.x *= scale;
    r.y *= scale;
    r.scale = scale;
    r.width_px = kFirstWidthPx * scale;
  }
  return ridgels;
}

/// Share of the lines' length that coarser sizes show best.
float share_of_wide(const std::vector<Ridgel>& ridgels) {
  float wide = 0;
  float all = 0;
  for (const Ridgel& r : ridgels) {
    all += r.scale;
    if (r.scale > 1) wide += r.scale;
  }
  return all > 0 ? wide / all : 0.F;
}

/// share_of_wide(), from every fourth coarse ridgel by itself.
float sampled_share_of_wide(const std::vector<SizedRidgels>& sizes, float weakest) {
  constexpr std::size_t kStep = 4;
  const cv::Size full_size = sizes[0].image.size();
  float wide = 0;
  float scale = 2;
  std::vector<Ridgel> finer = sizes[0].ridgels;
  for (std::size_t k = 1; k < sizes.size(); ++k, scale *= 2) {
    std::vector<Ridgel> coarse = at_full_size(sizes[k].ridgels, scale, weakest);
    const FinerLook look(finer, sizes[k - 1].image, 0.5F * scale, full_size);
    for (std::size_t i = 0; i < coarse.size(); i += kStep)
      if (look.is_best(coarse[i])) wide += kStep * scale;
    finer = std::move(coarse);
  }
  return wide > 0 ? wide / (wide + static_cast<float>(sizes[0].ridgels.size())) : 0.F;
}

}  // namespace

std::vector<Ridgel> choose_sizes(const std::vector<SizedRidgels>& sizes, float weakest,
                                 std::size_t usual) {
  const SizedRidgels& full = sizes[0];
  if (sizes.size() == 1) return full.ridgels;
  // Mostly, a look at a sample is enough.
  if (usual > 0 || sampled_share_of_wide(sizes, weakest) >= 0.5F * kWidePicture) {
    std::vector<Ridgel> chosen = full.ridgels;
    float scale = 2;
    for (std::size_t k = 1; k < sizes.size(); ++k, scale *= 2) {
      add_wider(at_full_size(sizes[k].ridgels, scale, weakest), sizes[k - 1].image,
                full.image.size(), k <= usual, chosen);
    }
    if (usual > 0 || share_of_wide(chosen) >= kWidePicture) return chosen;
  }
  return merged_scales(full.image, full.ridgels, enlarged(sizes[1].ridgels));
}

}  // namespace pencilscan
