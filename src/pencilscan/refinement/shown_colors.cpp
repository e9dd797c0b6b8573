#include "pencilscan/refinement/shown_colors.h"

#include <algorithm>
#include <cmath>

#include "pencilscan/core/name_list.h"
#include "pencilscan/pattern/color_likeness.h"

namespace pencilscan {
namespace {

constexpr int kFarthest = 16;  // lines

int reach_of(const LinePattern& pattern) { return std::min(kFarthest, pattern.period() / 2); }

/// The likeliest colour of a curve's point, and how much it tells: 0 where another is as likely.
struct SeenColor {
  int color = 0;
  double weight = 0;
};

SeenColor seen_color(const float* code, int colors) {
  SeenColor seen;
  float second = -INFINITY;
  for (int k = 1; k < colors; ++k) {
    if (code[k] > code[seen.color]) {
      second = code[seen.color];
      seen.color = k;
    } else {
      second = std::max(second, code[k]);
    }
  }
  seen.weight = 1 - std::exp(static_cast<double>(second - code[seen.color]));
  return seen;
}

/// Of each colour of a family, whether no other one can look like it.
std::vector<char> firm_colors(const ColorFamily& family) {
  std::vector<char> firm;
  for (const PatternColor& color : family.colors)
    firm.push_back(
        std::none_of(family.colors.begin(), family.colors.end(),
                     [&](const PatternColor& other) { return is_rest_of(color, other); }));
  return firm;
}

/// Share of a pattern's lines that have each symbol.
std::vector<double> symbol_shares(const LinePattern& lines) {
  std::vector<double> shares(static_cast<std::size_t>(lines.alphabet), 0);
  for (int line = 0; line < lines.period(); ++line)
    shares[static_cast<std::size_t>(lines.symbol(line))] += 1.0 / lines.period();
  return shares;
}

/// Share of a pattern's lines that have the colour of a line by chance.
double chance_of(const LinePattern& lines) {
  double chance = 0;
  for (const double share : symbol_shares(lines)) chance += share * share;
  return chance;
}

}  // namespace

ShownColorCount::ShownColorCount(const Rig& rig) : rig_(&rig), seen_(rig.cameras.size()) {
  for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
    for (std::size_t k = 0; k < rig.projectors[p].patterns.size(); ++k) {
      const PatternRef ref{static_cast<int>(p), static_cast<int>(k)};
      const auto shifts = static_cast<std::size_t>(2 * reach_of(pattern(ref)) + 1);
      counts_.push_back({ref, chance_of(pattern(ref)), 0, 0, std::vector<double>(shifts, 0), {}});
    }
  }
  for (std::vector<Seen>& in_camera : seen_) in_camera.resize(counts_.size());
}

const LinePattern& ShownColorCount::pattern(PatternRef ref) const {
  return rig_->projectors[static_cast<std::size_t>(ref.projector)]
      .patterns[static_cast<std::size_t>(ref.pattern)];
}

void ShownColorCount::add(const std::vector<ColorFamily>& families,
                          std::span<const GridGraph> graphs, const Labeling& labeling) {
  std::vector<std::vector<char>> firm_of;
  for (const ColorFamily& family : families) firm_of.push_back(firm_colors(family));
  for (const GridGraph& graph : graphs) {
    for (const LabeledRun& run : labeling.runs[static_cast<std::size_t>(graph.camera)]) {
      const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
      const ColorFamily& family = families[static_cast<std::size_t>(curve.family)];
      const int colors = static_cast<int>(family.colors.size());
      const auto count = std::find_if(counts_.begin(), counts_.end(),
                                      [&](const Count& c) { return c.ref == run.label.pattern; });
      if (colors < 2 || count == counts_.end()) continue;
      const LinePattern& lines = pattern(count->ref);
      const std::vector<int> color_of = family.color_of_symbol(lines);
      const int reach = reach_of(lines);
      const std::vector<char>& firm = firm_of[static_cast<std::size_t>(curve.family)];
      int firm_points = 0;
      Seen& in_camera = seen_[static_cast<std::size_t>(graph.camera)]
                             [static_cast<std::size_t>(count - counts_.begin())];
      ++count->runs;
      count->seen.resize(family.colors.size(), 0);
      ++in_camera.all.runs;
      const auto color_at = [&](int shift) {
        // Lines before the first one are those of the period before.
        const int id = (run.label.line + shift + lines.period() * kFarthest) % lines.period();
        return color_of[static_cast<std::size_t>(lines.symbol(id))];
      };
      for (int i = run.begin; i < run.end; ++i) {
        const SeenColor seen =
            seen_color(curve.code.data() + static_cast<std::ptrdiff_t>(i) * colors, colors);
        count->weight += seen.weight;
        count->seen[static_cast<std::size_t>(seen.color)] += seen.weight;
        for (int shift = -reach; shift <= reach; ++shift) {
          if (color_at(shift) == seen.color)
            count->agree[static_cast<std::size_t>(shift + reach)] += seen.weight;
        }
        const bool agrees = color_at(0) == seen.color;
        in_camera.all.add(seen.weight, agrees);
        if (firm[static_cast<std::size_t>(seen.color)] == 0) continue;
        count->firm.add(seen.weight, agrees);
        in_camera.firm.add(seen.weight, agrees);
        ++firm_points;
      }
      if (2 * firm_points > run.end - run.begin) {
        ++count->firm.runs;
        ++in_camera.firm.runs;
      }
    }
  }
}

std::vector<ShownColors> ShownColorCount::shown() const {
  std::vector<ShownColors> result;
  for (const Count& count : counts_) {
    const LinePattern& lines = pattern(count.ref);
    const int reach = reach_of(lines);
    const std::vector<double> shares = symbol_shares(lines);
    ShownColors& shown = result.emplace_back();
    shown.pattern = count.ref;
    shown.runs = count.runs;
    if (!(count.weight > 0)) continue;  // no colour tells
    shown.chance = count.chance;
    shown.one_color = *std::max_element(count.seen.begin(), count.seen.end()) / count.weight;
    shown.firm_runs = count.firm.runs;
    shown.firm_share = count.firm.share();
    shown.most_lines = *std::max_element(shares.begin(), shares.end());
    const auto share_at = [&](int shift) {
      return count.agree[static_cast<std::size_t>(shift + reach)] / count.weight;
    };
    shown.share = shown.shifted_share = share_at(0);
    for (int far = 1; far <= reach; ++far) {
      for (const int shift : {-far, far}) {
        if (!(share_at(shift) > shown.shifted_share)) continue;
        shown.shift = shift;
        shown.shifted_share = share_at(shift);
      }
    }
  }
  return result;
}

std::vector<ShownColors> ShownColorCount::seen() const {
  const std::vector<ShownColors> of_patterns = shown();
  std::vector<ShownColors> result;
  for (const std::vector<Seen>& in_camera : seen_) {
    ShownColors& seen = result.emplace_back();
    Tally all;
    Tally firm;
    double chance = 0;
    for (std::size_t k = 0; k < counts_.size(); ++k) {
      if (!(counts_[k].chance < 1) || of_patterns[k].all_look_alike()) continue;
      all.add(in_camera[k].all);
      firm.add(in_camera[k].firm);
      chance += counts_[k].chance * in_camera[k].all.weight;
    }
    seen.runs = all.runs;
    if (!(all.weight > 0)) continue;
    seen.chance = chance / all.weight;
    seen.share = seen.shifted_share = all.share();
    seen.firm_runs = firm.runs;
    seen.firm_share = firm.share();
  }
  return result;
}

std::string ShownColorCount::alike() const {
  std::string names;
  for (const ShownColors& of_pattern : shown()) {
    if (of_pattern.all_look_alike())
      add_name(names,
               rig_->projectors[static_cast<std::size_t>(of_pattern.pattern.projector)].name);
  }
  return names;
}

std::string ShownColorCount::denied() const {
  std::string names;
  for (const ShownColors& of_pattern : shown()) {
    if (of_pattern.deny())
      add_name(names,
               rig_->projectors[static_cast<std::size_t>(of_pattern.pattern.projector)].name);
  }
  const std::vector<ShownColors> of_cameras = seen();
  for (std::size_t c = 0; c < of_cameras.size(); ++c)
    if (of_cameras[c].deny()) add_name(names, rig_->cameras[c].name);
  return names;
}

}  // namespace pencilscan
