#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/labeling/labeling.h"
#include "pencilscan/rig/rig.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan {

/// What the colours of labelled curves say of the names of one pattern's lines, or of all lines in
/// one camera (without a pattern and a shift). A device that stands elsewhere may have every
/// crossing agree with names that are whole lines off; colours do not agree then.
struct ShownColors {
  PatternRef pattern;
  std::size_t runs = 0;  ///< stretches with a name
  double chance = 1;     ///< share that would agree if names had no meaning
  double share = 0;      ///< of the points, by what their colours tell: they have their line's
  /// The same of those points, and how many stretches there are of them, whose colour no other one
  /// can look like: a coloured surface makes red of yellow and blue of cyan, but nothing makes
  /// yellow or cyan. Wrong names have wrong colours both ways.
  double firm_share = 1;
  std::size_t firm_runs = 0;
  int shift = 0;  ///< if all lines were named so much further, most would agree
  double shifted_share = 0;
  double one_color = 0;   ///< share of the points that have the colour that most of them have
  double most_lines = 1;  ///< share of the pattern's lines that have the commonest colour

  /// Lines are of several colours and are all seen in one: their colours say nothing of names. So
  /// it is where an object gives back only what these colours have in common.
  [[nodiscard]] bool all_look_alike() const {
    return runs >= 30 && chance < 1 && one_color > std::max(0.9, 0.5 * (most_lines + 1));
  }
  /// Half of what lies between chance and certainty. Right names have .9 and more, names a few
  /// lines off what chance gives; in between lie patterns of which some places are named wrong.
  [[nodiscard]] bool deny() const {
    const double least = 0.5 * (chance + 1);
    return tell() && share < least && firm_runs >= 8 && firm_share < least;
  }
  /// Which shift is right, where they deny the names as they are; 0: none is.
  [[nodiscard]] int better_shift() const {
    return deny() && shifted_share > 0.5 * (chance + 1) ? shift : 0;
  }

 private:
  /// Stretches are of many lines then: by chance two colours agree in 3 of 4 of 30 lines once in
  /// 300 times.
  [[nodiscard]] bool tell() const { return runs >= 30 && chance < 1 && !all_look_alike(); }
};

/// Counts over frames. Shifts are looked for up to half a period of the code, beyond which they
/// begin anew, and up to 16 lines.
class ShownColorCount {
 public:
  /// The rig must outlive it.
  explicit ShownColorCount(const Rig& rig);
  void add(const std::vector<ColorFamily>& families, std::span<const GridGraph> graphs,
           const Labeling& labeling);
  /// By pattern, in the order of projectors and patterns.
  [[nodiscard]] std::vector<ShownColors> shown() const;
  /// By camera, over the patterns whose lines do not all look alike.
  [[nodiscard]] std::vector<ShownColors> seen() const;
  /// Names of the projectors and cameras that these deny; empty: none.
  [[nodiscard]] std::string denied() const;
  /// Names of the projectors whose lines all look alike.
  [[nodiscard]] std::string alike() const;

 private:
  /// Points by what their colours tell, and those whose line has their colour.
  struct Tally {
    std::size_t runs = 0;
    double weight = 0;
    double agree = 0;

    void add(double point_weight, bool agrees) {
      weight += point_weight;
      if (agrees) agree += point_weight;
    }
    void add(const Tally& other) {
      runs += other.runs;
      weight += other.weight;
      agree += other.agree;
    }
    [[nodiscard]] double share() const { return weight > 0 ? agree / weight : 1; }
  };
  struct Count {
    PatternRef ref;
    double chance = 1;
    std::size_t runs = 0;
    double weight = 0;
    std::vector<double> agree;  ///< per shift, from -reach
    std::vector<double> seen;   ///< weight per colour of the family
    Tally firm = {};
  };
  [[nodiscard]] const LinePattern& pattern(PatternRef ref) const;

  /// Of a camera and a pattern.
  struct Seen {
    Tally all;
    Tally firm;
  };

  const Rig* rig_;
  std::vector<Count> counts_;
  std::vector<std::vector<Seen>> seen_;  ///< by camera, then as counts_
};

}  // namespace pencilscan
