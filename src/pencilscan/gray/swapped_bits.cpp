#include "pencilscan/gray/swapped_bits.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

constexpr std::size_t kFewestChanges = 24;  // of a bit that is judged

/// Per bit of one axis: the codes of which that bit alone changes between neighbours, that bit
/// left out, and how often.
using Changes = std::vector<std::map<std::uint32_t, std::size_t>>;

/// The bits of a pixel, where all of them but `but` are certain.
class CertainBits {
 public:
  CertainBits(const GrayStack& stack, std::size_t axis, const DecodedView& decoded,
              const GrayDecodeOptions& options)
      : stack_(stack), bits_(stack.difference[axis]), options_(options) {
    // A bit is the difference of two images, or 2 pattern - white - black.
    least_ = options.bit_deviations * decoded.noise * std::sqrt(stack.inverses ? 2.0 : 6.0);
  }

  /// The bit that alone differs between two pixels, and the others of both.
  [[nodiscard]] std::optional<std::pair<std::size_t, std::uint32_t>> change(cv::Point a,
                                                                            cv::Point b) const {
    std::optional<std::size_t> changed;
    std::uint32_t others = 0;
    for (std::size_t k = 0; k < bits_.size(); ++k) {
      const float at_a = bits_[k].at<float>(a);
      const float at_b = bits_[k].at<float>(b);
      if ((at_a > 0) != (at_b > 0)) {
        if (changed) return std::nullopt;
        changed = k;
        continue;
      }
      if (std::abs(at_a) < least(a) || std::abs(at_b) < least(b)) return std::nullopt;
      if (at_a > 0) others |= 1U << k;
    }
    if (!changed) return std::nullopt;
    return std::pair{*changed, others};
  }

 private:
  [[nodiscard]] double least(cv::Point at) const {
    const double contrast = stack_.white.at<float>(at) - stack_.black.at<float>(at);
    return std::max(least_, options_.bit_contrast * contrast);
  }

  const GrayStack& stack_;
  const std::vector<cv::Mat>& bits_;
  const GrayDecodeOptions& options_;
  double least_ = 0;
};

Changes changes_of(const GrayStack& stack, std::size_t axis, const DecodedView& decoded,
                   const GrayDecodeOptions& options) {
  Changes changes(stack.difference[axis].size());
  const CertainBits bits(stack, axis, decoded, options);
  const auto is_lit = [&](cv::Point p) {
    const auto state = static_cast<PixelState>(decoded.state(p));
    return state == PixelState::kValid || state == PixelState::kOffPanel ||
           state == PixelState::kInconsistent;
  };
  const cv::Rect image({0, 0}, decoded.state.size());
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      for (const cv::Point next : {cv::Point(u + 1, v), cv::Point(u, v + 1)}) {
        if (!image.contains(next) || !is_lit({u, v}) || !is_lit(next)) continue;
        if (const auto change = bits.change({u, v}, next)) ++changes[change->first][change->second];
      }
    }
  }
  return changes;
}

std::uint32_t exchanged(std::uint32_t word, std::size_t i, std::size_t j) {
  const std::uint32_t differs = (word >> i ^ word >> j) & 1U;
  return word ^ (differs << i | differs << j);
}

struct Misfit {
  std::size_t wrong_bits = 0;  ///< most of whose changes make the coordinate jump
  std::size_t jumps = 0;       ///< of all bits
};

/// With bits i and j in each other's place.
Misfit misfit(const Changes& changes, std::size_t i, std::size_t j, int longest_step) {
  Misfit misfit;
  for (std::size_t k = 0; k < changes.size(); ++k) {
    std::size_t all = 0;
    std::size_t jumps = 0;
    for (const auto& [others, count] : changes[k]) {
      const auto a = static_cast<int>(index_from_gray(exchanged(others, i, j)));
      const auto b = static_cast<int>(index_from_gray(exchanged(others | 1U << k, i, j)));
      all += count;
      if (std::abs(a - b) > longest_step) jumps += count;
    }
    if (all >= kFewestChanges && 2 * jumps > all) ++misfit.wrong_bits;
    misfit.jumps += jumps;
  }
  return misfit;
}

/// The pictures of a bit: "006", or "006, 007" with its inverse.
std::string pictures_of(const GrayStack& stack, std::size_t axis, std::size_t bit) {
  const auto sequence = gray_code_sequence(stack.panel_width, stack.panel_height, stack.inverses);
  std::string names;
  for (std::size_t i = 2; i < sequence.size(); ++i)
    if ((sequence[i].axis == Axis::kColumn) == (axis == 0) &&
        sequence[i].bit == static_cast<int>(bit))
      names += (names.empty() ? "" : ", ") + gray_code_file_stem(i);
  return names;
}

}  // namespace

std::string explain_swapped_bits(const GrayStack& stack, const DecodedView& decoded,
                                 const GrayDecodeOptions& options) {
  const int longest_step = 1 + static_cast<int>(options.steepest_code);
  for (const std::size_t axis : {0U, 1U}) {
    const Changes changes = changes_of(stack, axis, decoded, options);
    const Misfit before = misfit(changes, 0, 0, longest_step);
    if (before.wrong_bits == 0) continue;
    std::size_t fewest = before.jumps;
    std::string explanation;
    for (std::size_t i = 1; i < changes.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Misfit after = misfit(changes, i, j, longest_step);
        if (after.wrong_bits > 0 || after.jumps >= fewest) continue;
        fewest = after.jumps;
        explanation = "those of " + std::string(axis == 0 ? "column" : "row") + " bits " +
                      std::to_string(j) + " and " + std::to_string(i) + " are exchanged (" +
                      pictures_of(stack, axis, i) + " and " + pictures_of(stack, axis, j) + ")";
      }
    }
    if (!explanation.empty()) return explanation;
  }
  return {};
}

}  // namespace pencilscan
