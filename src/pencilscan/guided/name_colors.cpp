#include "pencilscan/guided/name_colors.h"

#include <algorithm>
#include <utility>

#include "pencilscan/core/stretches.h"
#include "pencilscan/detection/code_evidence.h"

namespace pencilscan {

std::vector<NamedPieces> pieces_of_names(const std::vector<std::optional<LineName>>& names) {
  std::vector<NamedPieces> result;
  for_each_stretch(names, [&](int begin, int end) {
    const auto& name = names[static_cast<std::size_t>(begin)];
    if (!name) return;
    auto known = std::find_if(result.begin(), result.end(),
                              [&](const NamedPieces& n) { return n.name == *name; });
    if (known == result.end()) known = result.insert(known, {*name, {}});
    known->pieces.push_back({begin, end});
  });
  return result;
}

int points_of(std::span<const PointRange> pieces) {
  int points = 0;
  for (const PointRange& s : pieces) points += s.end - s.begin;
  return points;
}

float NameColors::margin(const Curve& curve, const std::vector<PointRange>& pieces,
                         const LineName& name) const {
  const std::size_t colors = families_[static_cast<std::size_t>(curve.family)].colors.size();
  std::vector<float> sum(colors, 0.F);
  for (const PointRange& piece : pieces) {
    const std::vector<float> of_one = evidence(curve, piece);
    for (std::size_t k = 0; k < colors; ++k) sum[k] += of_one[k];
  }
  std::swap(sum[color_of(name, curve.family)], sum.back());
  const float of_name = sum.back();
  sum.pop_back();
  return sum.empty() ? 0 : of_name - *std::max_element(sum.begin(), sum.end());
}

float NameColors::lead(const Curve& curve, const PointRange& piece, const LineName& name,
                       const LineName& other) const {
  const std::vector<float> of_colors = evidence(curve, piece);
  return of_colors[color_of(name, curve.family)] - of_colors[color_of(other, curve.family)];
}

std::vector<float> NameColors::evidence(const Curve& curve, const PointRange& piece) const {
  return color_evidence(curve, piece.begin, piece.end,
                        families_[static_cast<std::size_t>(curve.family)].colors.size());
}

/// Which colour of its family a line has.
std::size_t NameColors::color_of(const LineName& name, int family) const {
  const LinePattern& pattern = rig_.pattern(name.pattern);
  return static_cast<std::size_t>(families_[static_cast<std::size_t>(family)].color_of_symbol(
      pattern)[static_cast<std::size_t>(pattern.symbol(name.line))]);
}

}  // namespace pencilscan
