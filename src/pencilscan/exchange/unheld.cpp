#include "pencilscan/exchange/unheld.h"

#include <algorithm>
#include <set>

#include "pencilscan/core/error.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {

std::vector<std::string> unheld_values(const Rig& rig) {
  const auto any_camera = [&](auto states) {
    return std::any_of(rig.cameras.begin(), rig.cameras.end(), states);
  };
  const auto any_projector = [&](auto states) {
    return std::any_of(rig.projectors.begin(), rig.projectors.end(), states);
  };
  const auto is_registered = [](const auto& device) { return !device.color_registration.none(); };
  std::vector<std::string> keys;
  const auto add = [&](bool is_stated, const char* key) {
    if (is_stated) keys.emplace_back(key);
  };
  add(any_projector([](const Projector& p) { return !p.patterns.empty(); }), "pattern");
  add(any_projector([](const Projector& p) { return !p.output.empty(); }), "output");
  add(any_camera([](const Camera& c) { return c.states_color_matrix(); }), "color_matrix");
  add(any_camera([](const Camera& c) { return c.gamma != 1; }), "gamma");
  add(any_camera([](const Camera& c) { return c.black_level != 0; }), "black_level");
  add(any_camera([](const Camera& c) { return c.mosaic.has_value(); }), "mosaic");
  add(any_camera([](const Camera& c) { return c.sees_texture_only; }), "role");
  add(any_camera(is_registered) || any_projector(is_registered), "color_registration");
  add(rig.volume.has_value(), "volume");
  add(rig.floor.has_value(), "floor");
  return keys;
}

void require_distinct_names(const Rig& rig) {
  std::set<std::string> names;
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    const std::string& name = device_at(rig, d).name;
    if (!names.insert(name).second)
      throw InputError("rig", "name", name, "must be that of one device: it names a file");
  }
}

}  // namespace pencilscan
