#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pencilscan {

enum class Grade { kGood, kDoubtful, kUnusable };
[[nodiscard]] std::string to_string(Grade grade);

/// Something to know about a calibration, in plain words.
struct Finding {
  Grade grade = Grade::kGood;  ///< what it makes of the calibration; good: a note
  std::string what;
  std::string advice;  ///< what to do; may be empty
  /// Devices of which nothing is left because of it: that they have no place needs no other reason.
  std::vector<std::size_t> explains{};
};

/// A share in the text of a finding: "0.42 %", to three digits.
[[nodiscard]] std::string share_text(double share);

}  // namespace pencilscan
