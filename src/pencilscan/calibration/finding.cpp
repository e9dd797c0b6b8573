#include "pencilscan/calibration/finding.h"

#include "pencilscan/core/formatted.h"

namespace pencilscan {

std::string to_string(Grade grade) {
  switch (grade) {
    case Grade::kGood:
      return "good";
    case Grade::kDoubtful:
      return "doubtful";
    case Grade::kUnusable:
      return "unusable";
  }
  return "unknown";
}

std::string share_text(double share) { return formatted(100 * share, "%.3g %%"); }

}  // namespace pencilscan
