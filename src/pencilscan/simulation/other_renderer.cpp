#include "pencilscan/simulation/other_renderer.h"

#include "pencilscan/core/error.h"

namespace pencilscan {

void check_other_renderer_can_show(const Rig& rig, const std::filesystem::path& rig_path,
                                   const std::string& option, const std::string& name) {
  const auto refuse = [&](const std::string& field, const std::string& rule) {
    throw InputError(rig_path.string(), field, "", rule);
  };
  const auto check_registration = [&](const auto& device) {
    if (!device.color_registration.none()) {
      refuse(device.name + ".color_registration",
             "must be absent for " + option + ": it bends all colours alike");
    }
  };
  for (const Camera& camera : rig.cameras) {
    if (camera.has_distortion()) {
      refuse(camera.name + ".distortion",
             "must be zero for " + option + ": " + name + " has no distorted camera");
    }
    if (camera.states_color_matrix()) {
      refuse(camera.name + ".color_matrix",
             "must be absent for " + option + ": its lights have pure colours");
    }
    check_registration(camera);
  }
  for (const Projector& projector : rig.projectors) check_registration(projector);
}

}  // namespace pencilscan
