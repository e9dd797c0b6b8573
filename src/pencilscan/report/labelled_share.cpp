#include "pencilscan/report/labelled_share.h"

#include <nlohmann/json.hpp>

namespace pencilscan {

std::optional<double> labelled_share(const nlohmann::json& report) {
  const auto cameras = report.find("cameras");
  if (cameras == report.end() || !cameras->is_array()) return std::nullopt;
  double points = 0;
  double labelled = 0;
  for (const auto& camera : *cameras) {
    const auto number = [&](const char* key) {
      const auto found = camera.find(key);
      return found != camera.end() && found->is_number() ? found->get<double>() : 0.0;
    };
    points += number("curve_points");
    labelled += number("labelled_curve_points");
  }
  return points > 0 ? std::optional(labelled / points) : std::nullopt;
}

}  // namespace pencilscan
