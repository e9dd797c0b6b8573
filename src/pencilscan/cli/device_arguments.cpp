#include "pencilscan/cli/device_arguments.h"

#include <cmath>
#include <exception>

#include "pencilscan/core/error.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan::cli {

std::size_t device_by_name(const Rig& rig, const std::string& name, const std::string& option) {
  for (std::size_t d = 0; d < device_count(rig); ++d)
    if (device_at(rig, d).name == name) return d;
  throw InputError("command line", option, name, "must be the name of a device");
}

std::optional<double> positive_number(const std::string& text) {
  try {
    std::size_t used = 0;
    const double value = std::stod(text, &used);
    if (used == text.size() && std::isfinite(value) && value > 0) return value;
  } catch (const std::exception&) {
    return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace pencilscan::cli
