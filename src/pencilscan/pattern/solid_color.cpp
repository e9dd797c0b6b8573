#include "pencilscan/pattern/solid_color.h"

namespace pencilscan {

std::vector<SolidImage> solid_images() {
  return {{"red", {1, 0, 0}},          {"green", {0, 1, 0}},
          {"blue", {0, 0, 1}},         {"grey25", {0.25, 0.25, 0.25}},
          {"grey50", {0.5, 0.5, 0.5}}, {"grey75", {0.75, 0.75, 0.75}}};
}

}  // namespace pencilscan
