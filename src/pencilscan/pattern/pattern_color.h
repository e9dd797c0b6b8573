#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace pencilscan {

/// A colour the projector shows, as red, green, blue in [0, 1].
using Rgb = std::array<double, 3>;

/// blue, cyan, red, yellow, green, magenta, white; nothing for another name.
[[nodiscard]] std::optional<Rgb> color_from_name(std::string_view name);

/// The colour of a line: linear light, stated by a name or by three numbers. Equal light is the
/// same colour, however it was stated.
class PatternColor {
 public:
  /// `name` must be one that color_from_name() knows.
  PatternColor(const char* name);         // NOLINT(google-explicit-constructor)
  PatternColor(const std::string& name);  // NOLINT(google-explicit-constructor)
  /// Each number in [0, 1], not all 0.
  explicit PatternColor(const Rgb& light);

  [[nodiscard]] const Rgb& light() const { return light_; }
  /// The name of this light, or "[r, g, b]" where it has none.
  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] bool stated_by_name() const { return stated_by_name_; }

  friend bool operator==(const PatternColor& a, const PatternColor& b) {
    return a.light_ == b.light_;
  }
  /// The order of texts: any order would do, this one is easy to foresee.
  friend bool operator<(const PatternColor& a, const PatternColor& b) { return a.text_ < b.text_; }

 private:
  Rgb light_{};
  std::string text_;
  bool stated_by_name_ = true;
};

}  // namespace pencilscan
