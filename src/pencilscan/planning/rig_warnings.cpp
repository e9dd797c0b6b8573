#include <algorithm>

#include "pencilscan/core/formatted.h"
#include "pencilscan/planning/conventions.h"
#include "pencilscan/planning/rig_check.h"
#include "pencilscan/planning/units.h"

namespace pencilscan {
namespace {

/// A line family gives little depth when less than this share of what cameras see of it is
/// sensitive enough, and none when its median sensitivity is below this part of the needed one.
constexpr double kLittleDepthShare = 0.15;
constexpr double kNoDepthPart = 0.5;
/// A camera or projector should have this share of the volume in its image.
constexpr double kEnoughView = 0.5;
/// Surface that should be measurable; of what is seen, less is a fault of the rig rather than a
/// partial rig.
constexpr double kEnoughUsable = 0.75;
constexpr double kTooFewUsable = 0.5;
/// Of the surface that is seen and lit, the share where two line sets should cross.
constexpr double kEnoughGrid = 0.4;
constexpr double kTooFewGrid = 0.1;
/// Views with same-colour ambiguity that are tolerable, and that are not.
constexpr double kSomeAmbiguity = 0.1;
constexpr double kMuchAmbiguity = 0.3;
/// Line spacings in the image, px: below the second, detection does not separate lines.
constexpr double kWideSpacing = 5;
constexpr double kNarrowSpacing = 3;
/// Two line sets are partners in a grid when they cross, and tell each other apart, on this share
/// of what shows both.
constexpr double kPartnerShare = 0.2;
/// Fewer shared samples than this say nothing about a pair.
constexpr double kFewSamples = 10;

/// Collects the warnings of one rig.
class Collector {
 public:
  Collector(const Rig& rig, const RigCheck& check, const RigCheckOptions& options)
      : rig_(rig), check_(check), options_(options) {}

  std::vector<RigWarning> collect() {
    check_conventions();
    check_patterns();
    check_views();
    check_depth();
    check_grid();
    check_axes();
    check_ambiguity();
    check_coverage();
    check_spacing();
    std::stable_partition(warnings_.begin(), warnings_.end(),
                          [](const RigWarning& warning) { return warning.severe; });
    return std::move(warnings_);
  }

 private:
  void warn(bool severe, const char* kind, std::string text) {
    warnings_.push_back({severe, kind, std::move(text)});
  }
  [[nodiscard]] std::string name(const LineFamily& family) const {
    const Projector& projector = rig_.projectors[family.projector];
    return projector.patterns.size() == 1
               ? projector.name
               : projector.name + " pattern " + std::to_string(family.pattern);
  }
  [[nodiscard]] const LinePattern& pattern(const LineFamily& family) const {
    return rig_.projectors[family.projector].patterns[family.pattern];
  }
  /// The colours tell lines apart at all.
  [[nodiscard]] bool has_code(const LineFamily& family) const {
    return pattern(family).period() > 1;
  }

  void check_conventions() {
    if (auto warning = pose_unit_warning(rig_)) warn(false, "unit", *std::move(warning));
    if (auto warning = shared_pose_warning(rig_)) warn(true, "same_pose", *std::move(warning));
    if (auto warning = pose_convention_warning(rig_)) warn(true, "convention", *std::move(warning));
    if (auto warning = intrinsics_convention_warning(rig_))
      warn(true, "convention", *std::move(warning));
  }

  void check_patterns() {
    for (const Projector& projector : rig_.projectors) {
      if (projector.patterns.empty()) {
        warn(false, "no_pattern", projector.name + " has no pattern: it measures nothing");
      }
      for (const LinePattern& lines : projector.patterns) check_colors(projector, lines);
    }
  }

  /// Colours of one code that are the same light, or one light at two levels: the picture knows no
  /// level, since surfaces differ in albedo.
  void check_colors(const Projector& projector, const LinePattern& lines) {
    const auto direction = [](const PatternColor& color) {
      const Rgb& light = color.light();
      return Vec3(light[0], light[1], light[2]).normalized();
    };
    constexpr double kOneDirection = 1e-3;  // as numbers of three digits state it
    for (std::size_t b = 0; b < lines.colors.size(); ++b) {
      for (std::size_t a = 0; a < b; ++a) {
        if ((direction(lines.colors[a]) - direction(lines.colors[b])).norm() > kOneDirection)
          continue;
        return warn(true, "equal_colors",
                    "the colours " + lines.colors[a].text() + " and " + lines.colors[b].text() +
                        " of " + projector.name +
                        " are one hue: the code says nothing where it needs both to be told apart");
      }
    }
  }

  void check_views() {
    const auto check_device = [&](const Device& device, double view) {
      if (view < kEnoughView) {
        warn(view <= 0, "out_of_view",
             device.name + " has only " + percent_text(view) +
                 " of the working volume in its image: turn it to the volume, move it away or "
                 "shorten its focal length");
      }
    };
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      check_device(rig_.cameras[c], check_.camera_view_share[c]);
    }
    for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
      check_device(rig_.projectors[p], check_.projector_view_share[p]);
    }
  }

  /// Lines along the epipolar lines of every camera that sees them.
  void check_depth() {
    for (std::size_t k = 0; k < check_.pairs.size(); ++k) {
      const LineFamily family = check_.pairs[k].family;
      if (check_.pairs[k].camera != check_.pairs.front().camera) break;  // each family once
      double shared = 0, sensitive = 0, sensitivity = 0;
      for (const PairCheck& pair : check_.pairs) {
        if (pair.family.projector != family.projector || pair.family.pattern != family.pattern) {
          continue;
        }
        const auto weight = static_cast<double>(pair.shared);
        shared += weight;
        sensitive += weight * pair.sensitive_share;
        sensitivity += weight * pair.sensitivity_median;
      }
      if (shared < kFewSamples) {
        warn(true, "unseen_light",
             name(family) + " lights nothing that a camera sees: move it or a camera");
      } else if (sensitive < kLittleDepthShare * shared) {
        warn_depth(family, sensitivity / shared, sensitive / shared);
      }
    }
  }

  /// A line set of another projector whose lines this one tells apart, or null.
  [[nodiscard]] const LineFamily* partner_of(const LineFamily& family) const {
    const auto is = [&](const LineFamily& other) {
      return other.projector == family.projector && other.pattern == family.pattern;
    };
    for (const AxesCheck& axes : check_.axes) {
      if (axes.first.projector == axes.second.projector || axes.crossing_share < kPartnerShare ||
          static_cast<double>(axes.shared) < kFewSamples)
        continue;
      if (is(axes.first)) return &axes.second;
      if (is(axes.second)) return &axes.first;
    }
    return nullptr;
  }

  void warn_depth(const LineFamily& family, double sensitivity, double share) {
    const LineFamily* partner = partner_of(family);
    const bool rows = pattern(family).axis == Axis::kRow;
    const bool none = sensitivity < kNoDepthPart * options_.min_sensitivity;
    warn(
        none && partner == nullptr, none ? "no_depth" : "little_depth",
        "the " + std::string(rows ? "horizontal" : "vertical") + " lines of " + name(family) +
            (none ? " give no depth" : " give little depth") + " (mean sensitivity " +
            formatted(sensitivity, "%.2f") + "; " + formatted(options_.min_sensitivity, "%.2f") +
            " is reached on " + percent_text(share) +
            " of what cameras see of them): they run along the epipolar lines of the cameras; " +
            (rows ? "raise or lower this projector to about 30 degrees off the cameras' height, or "
                    "let it show vertical lines"
                  : "move it sideways against the cameras, or let it show horizontal lines") +
            (partner == nullptr ? ""
                                : "; that they cross those of " + name(*partner) +
                                      " still tells which line is which"));
  }

  /// Share of the surface that is both seen and lit (partial rigs are judged by their part).
  [[nodiscard]] double of_lit(double share) const {
    return check_.coverage.seen_and_lit > 0 ? share / check_.coverage.seen_and_lit : 0;
  }

  /// Before one projector nothing tells lines apart but their code, and their order.
  void check_one_projector(std::size_t p) {
    const Projector& projector = rig_.projectors[p];
    bool coded = true;
    for (std::size_t k = 0; k < projector.patterns.size(); ++k) coded = coded && has_code({p, k});
    warn(!coded, "no_grid",
         projector.name +
             (coded ? " is the only projector: nothing crosses its lines but lines of its own, and "
                      "the code of their colours alone tells which is which; a second projector "
                      "makes that surer"
                    : " is the only projector, and no code tells its lines apart: give them "
                      "one, or add a projector"));
  }

  void check_grid() {
    std::vector<std::size_t> at_work;
    for (std::size_t p = 0; p < rig_.projectors.size(); ++p)
      if (!rig_.projectors[p].patterns.empty()) at_work.push_back(p);
    if (at_work.size() == 1) return check_one_projector(at_work.front());
    const double grid = of_lit(check_.coverage.grid);
    if (grid >= kEnoughGrid) return;
    const double two_views = of_lit(check_.coverage.two_views);
    const bool has_views = two_views >= kEnoughGrid;
    warn(grid < kTooFewGrid && !has_views, "no_grid",
         "only " + percent_text(grid) +
             " of the surface that is seen and lit shows some camera line sets of different "
             "projectors that cross and tell each other apart: crossings decide which line is "
             "which" +
             (has_views ? ", and where there are none, two cameras that see the same lines (" +
                              percent_text(two_views) + " of it) and the code"
                        : std::string()) +
             "; mix directions of lines, and let neighbouring projectors overlap");
  }

  /// Coplanar axes among the pairs that make up the grid, and what is left without them.
  void check_axes() {
    const double grid = of_lit(check_.coverage.grid);
    const double left = of_lit(check_.coverage.skew_grid);
    const bool severe = grid >= kTooFewGrid && left < kEnoughGrid && left < 0.5 * grid;
    for (const AxesCheck& axes : check_.axes) {
      if (static_cast<double>(axes.shared) < kFewSamples || axes.crossing_share < kPartnerShare)
        continue;
      if (axes.skewness >= options_.min_skewness) continue;
      // Families of one colour are no grid of the paper's kind; coplanarity matters where they are
      // all that there is, or where colours differ.
      if (axes.same_color && !severe) continue;
      if (axes.first.projector == axes.second.projector) {
        warn(severe, "coplanar_axes",
             name(axes.first) + " and " + name(axes.second) +
                 " come from one projector: their crossings say nothing about depth; " +
                 (has_code(axes.first) && has_code(axes.second)
                      ? "the code of their colours tells lines apart (method joint), and a second "
                        "projector would add crossings that do"
                      : "no code tells their lines apart: give them one, or add a projector"));
        continue;
      }
      warn(severe, "coplanar_axes",
           "the line directions of " + name(axes.first) + " and " + name(axes.second) +
               " lie in one plane (skewness " + formatted(axes.skewness, "%.3f") + ", axes " +
               formatted(axes.distance_mm) + " " + unit_name(rig_) +
               " apart): equation (6) keeps a free parameter for this pair, as for "
               "mirror-symmetric diagonal lines; raise one of the two or roll it differently");
    }
  }

  void check_ambiguity() {
    const double ambiguous = check_.coverage.ambiguous;
    if (ambiguous < kSomeAmbiguity) return;
    const AxesCheck* worst = nullptr;
    double most = 0;
    for (const AxesCheck& axes : check_.axes) {
      const double views = axes.parallel_share * static_cast<double>(axes.shared);
      if (axes.same_color && views > most) {
        most = views;
        worst = &axes;
      }
    }
    if (worst == nullptr) return;
    warn(ambiguous >= kMuchAmbiguity, "same_color",
         percent_text(ambiguous) +
             " of what the cameras see has two line sets of the same colour in nearly the same "
             "direction (most often " +
             name(worst->first) + " and " + name(worst->second) +
             "): give them different colours or directions, or move them apart");
  }

  void check_coverage() {
    const CoverageCheck& coverage = check_.coverage;
    if (coverage.usable >= kEnoughUsable) return;
    warn(coverage.usable < kTooFewUsable * coverage.seen, "coverage",
         "only " + percent_text(coverage.usable) + " of the surface can be measured (" +
             percent_text(coverage.seen) + " is seen, " + percent_text(coverage.lit) + " is lit, " +
             percent_text(coverage.seen_and_lit) +
             " is both): add devices where they are missing, or accept a partial shape");
  }

  void check_spacing() {
    std::size_t shared = 0;
    double weighted = 0;
    for (const PairCheck& pair : check_.pairs) {
      shared += pair.shared;
      weighted += pair.spacing_median_px * static_cast<double>(pair.shared);
    }
    if (shared == 0) return;
    const double spacing = weighted / static_cast<double>(shared);
    if (spacing >= kWideSpacing) return;
    warn(spacing < kNarrowSpacing, "spacing",
         "lines lie only " + formatted(spacing, "%.1f") +
             " px apart in the images: enlarge pitch_px or use cameras of higher resolution");
  }

  const Rig& rig_;
  const RigCheck& check_;
  const RigCheckOptions& options_;
  std::vector<RigWarning> warnings_;
};

}  // namespace

std::vector<RigWarning> rig_warnings(const Rig& rig, const RigCheck& check,
                                     const RigCheckOptions& options) {
  return Collector(rig, check, options).collect();
}

}  // namespace pencilscan
