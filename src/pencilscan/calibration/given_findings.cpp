#include "pencilscan/calibration/given_findings.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

class GivenJudge {
 public:
  GivenJudge(const CalibrationInput& input, const CalibrationResult& result)
      : input_(input), result_(result) {}

  std::vector<Finding> findings() {
    const std::string unit = tolerances();
    const std::string advice =
        "check that K is of this lens, focus and image size, or say how rough it is "
        "(--focal-tolerance, --center-tolerance)";
    std::string moved_within;
    std::vector<char> within(result_.placed.size(), 0);
    for (std::size_t d = 0; d < result_.placed.size(); ++d) {
      if (result_.given[d] == GivenUse::kNone || result_.placed[d] == 0) continue;
      const BundleDevice& found = result_.problem.devices[d];
      const auto moved = moved_deviations(device_at(input_.rig, d), result_.tolerance, found);
      const auto most =
          static_cast<std::size_t>(std::max_element(moved.begin(), moved.end()) - moved.begin());
      if (is_given(result_, d) && moved[most] <= kContradictsDeviations) {
        if (moved[most] > 0)
          add_name(moved_within,
                   name(d) + " by " + kIntrinsicNames[most] + " " + formatted(moved[most]));
        within[d] = 1;
        continue;
      }
      const bool is_free = result_.given[d] == GivenUse::kContradicted;
      add(Grade::kDoubtful,
          "the data contradict the given K of " + name(d) + ": " +
              how_far_off(d, most, moved[most]) +
              (is_free ? ", so it was only a start" : ", though it was held near it"),
          advice);
    }
    // A single one would be named above.
    const double together = common_pull(input_, within, result_.tolerance, result_.problem);
    if (together > kContradictsDeviations)
      add(Grade::kDoubtful,
          "the data contradict the given K together: that all are off by as much is as unlikely "
          "as " +
              formatted(together) +
              " standard deviations, though each alone is near its tolerance (" + unit + ")",
          advice);
    if (moved_within.empty() && std::count(within.begin(), within.end(), 1) > 0)
      add(Grade::kGood, "given K were kept exactly");
    if (!moved_within.empty())
      add(Grade::kGood,
          "given K were kept; they moved, in their tolerances (" + unit + "): " + moved_within);
    return std::move(findings_);
  }

 private:
  void add(Grade grade, const std::string& what, const std::string& advice = {}) {
    findings_.push_back({grade, what, advice});
  }
  [[nodiscard]] const std::string& name(std::size_t d) const {
    return device_at(input_.rig, d).name;
  }

  /// The tolerances of given K.
  [[nodiscard]] std::string tolerances() const {
    return share_text(result_.tolerance.focal) + ", " + formatted(result_.tolerance.center_px) +
           " px";
  }

  /// `moved`: tolerances; infinite where there is none.
  [[nodiscard]] std::string how_far_off(std::size_t d, std::size_t intrinsic, double moved) const {
    const std::string what = kIntrinsicNames[intrinsic];
    if (std::isfinite(moved))
      return what + " " + formatted(moved) + " of its tolerances (" + tolerances() + ") off";
    const double stated = bundle_device(device_at(input_.rig, d)).inner[intrinsic];
    return what + " is " + formatted(result_.problem.devices[d].inner[intrinsic], "%.5g") +
           ", and was stated exactly as " + formatted(stated, "%.5g");
  }

  const CalibrationInput& input_;
  const CalibrationResult& result_;
  std::vector<Finding> findings_;
};

}  // namespace

bool is_given(const CalibrationResult& result, std::size_t device) {
  return result.given[device] == GivenUse::kTolerance || result.given[device] == GivenUse::kExact;
}

std::vector<Finding> given_findings(const CalibrationInput& input,
                                    const CalibrationResult& result) {
  return GivenJudge(input, result).findings();
}

}  // namespace pencilscan
