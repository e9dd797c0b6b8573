#include "pencilscan/pattern/pattern_color.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <sstream>

#include "pencilscan/core/check.h"

namespace pencilscan {
namespace {

struct NamedLight {
  const char* name;
  Rgb light;
};

constexpr std::array<NamedLight, 7> kNamed{{{"blue", {0, 0, 1}},
                                            {"cyan", {0, 1, 1}},
                                            {"red", {1, 0, 0}},
                                            {"yellow", {1, 1, 0}},
                                            {"green", {0, 1, 0}},
                                            {"magenta", {1, 0, 1}},
                                            {"white", {1, 1, 1}}}};

/// Enough digits to tell any two lights apart.
std::string text_of(const Rgb& light) {
  for (const NamedLight& named : kNamed)
    if (named.light == light) return named.name;
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "[" << light[0] << ", "
       << light[1] << ", " << light[2] << "]";
  return text.str();
}

}  // namespace

std::optional<Rgb> color_from_name(std::string_view name) {
  for (const NamedLight& named : kNamed)
    if (name == named.name) return named.light;
  return std::nullopt;
}

PatternColor::PatternColor(const char* name) : PatternColor(std::string(name)) {}

PatternColor::PatternColor(const std::string& name) : text_(name) {
  const auto light = color_from_name(name);
  PENCILSCAN_CHECK(light.has_value());
  light_ = *light;
}

PatternColor::PatternColor(const Rgb& light)
    : light_(light), text_(text_of(light)), stated_by_name_(false) {
  PENCILSCAN_CHECK(
      std::all_of(light.begin(), light.end(), [](double v) { return v >= 0 && v <= 1; }));
  PENCILSCAN_CHECK(light != Rgb{});
}

}  // namespace pencilscan
