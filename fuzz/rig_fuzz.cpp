// rig.json: any text, and valid rigs with absurd values, through everything that looks at a rig
// without images.

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "fuzz.h"
#include "pencilscan/pattern/line_pattern.h"
#include "pencilscan/planning/rig_check.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/planning/units.h"
#include "pencilscan/rig/rig_text.h"
#include "pencilscan/view/color_family.h"

namespace pencilscan::fuzz {
namespace {

using Json = nlohmann::json;

/// Values that no device has, and some that a few have.
Json absurd(Choices& choices) {
  static const std::array<Json, 36> kValues = {0,
                                               -0.0,
                                               1,
                                               -1,
                                               2,
                                               3,
                                               5,
                                               0.01,
                                               1e-9,
                                               1e-300,
                                               1e300,
                                               -1e300,
                                               1e9,
                                               255,
                                               256,
                                               257,
                                               65500,
                                               65535,
                                               65536,
                                               1e18,
                                               0.5,
                                               1e-320,
                                               12.0,
                                               100.5,
                                               "",
                                               "proj0",
                                               "red",
                                               "RGGB",
                                               "../a",
                                               true,
                                               nullptr,
                                               Json::array(),
                                               Json::object(),
                                               Json::array({1, 0, 0}),
                                               Json::array({0, 0, 0}),
                                               Json::array({1e300, 1e300, 1e300})};
  return kValues[choices.below(kValues.size())];
}

/// A place in a rig, found by going down at random.
Json& place(Json& root, Choices& choices) {
  Json* at = &root;
  for (int depth = 0; depth < 8 && at->is_structured() && !at->empty(); ++depth) {
    if (depth > 1 && choices.below(6) == 0) break;
    auto next = at->begin();
    std::advance(next, static_cast<std::ptrdiff_t>(choices.below(at->size())));
    at = &*next;
  }
  return *at;
}

const std::array<const char*, 9> kOptionalKeys = {"gamma", "black_level", "mosaic",
                                                  "role",  "volume",      "floor",
                                                  "lines", "sequence",    "color_matrix"};

/// Many devices, each under a name of its own.
void multiply(Json& devices, std::size_t count) {
  if (!devices.is_array() || devices.empty()) return;
  const Json first = devices.front();
  while (devices.size() < count) {
    devices.push_back(first);
    if (first.is_object()) devices.back()["name"] = "d" + std::to_string(devices.size());
  }
}

std::string rig_of_choices(Choices choices) {
  static const Json kRing = [] {
    RingOptions options;
    options.cameras = options.projectors = 2;
    return Json::parse(rig_text(make_ring(options)));
  }();
  // Few, and around the greatest number that is allowed; once, since each takes time to read.
  static const std::array<std::size_t, 6> kCounts = {1, 3, 4, 255, 256, 257};
  bool is_multiplied = false;
  Json rig = kRing;
  for (int changes = 0; choices.any() && changes < 24; ++changes) {
    Json& at = place(rig, choices);
    switch (choices.below(5)) {
      case 0:
        if (!std::exchange(is_multiplied, true))
          multiply(rig[choices.below(2) == 0 ? "cameras" : "projectors"],
                   kCounts[choices.below(16) == 0 ? 3 + choices.below(3) : choices.below(3)]);
        break;
      case 1:
        if (at.is_object())
          at[kOptionalKeys[choices.below(kOptionalKeys.size())]] = absurd(choices);
        break;
      case 2:
        if (at.is_array() && !at.empty()) at.push_back(at.front());
        break;
      default:
        at = absurd(choices);
    }
  }
  return rig.dump();
}

/// What looks at a rig, in bounded time: the check grows with families squared.
void look_at(const Rig& rig) {
  constexpr std::size_t kMostFamilies = 8;
  constexpr double kMostPixels = 5000;  // what is drawn is alike from pixel to pixel
  const Sphere volume = working_volume(rig);
  static_cast<void>(footprint(rig));
  static_cast<void>(volume_unit_warning(rig));
  const auto families = color_families(rig);
  for (const Camera& camera : rig.cameras) {
    static_cast<void>(camera.project(volume.center));
    static_cast<void>(camera.ray({0.5 * camera.width, 0.5 * camera.height}));
  }
  std::size_t patterns = 0;
  for (const Projector& projector : rig.projectors) {
    patterns += projector.patterns.size();
    for (const LinePattern& pattern : projector.patterns)
      static_cast<void>(projector.line_count(pattern));
    if (static_cast<double>(projector.width) * projector.height <= kMostPixels &&
        !projector.patterns.empty())
      static_cast<void>(render_patterns(projector.patterns, projector.width, projector.height));
  }
  if (rig.cameras.size() + patterns > kMostFamilies) return;
  RigCheckOptions options;
  options.points_per_sphere = 4;
  static_cast<void>(check_rig(rig, options));
}

}  // namespace
}  // namespace pencilscan::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan;
  using namespace pencilscan::fuzz;
  const std::string_view input = text_of(data, size);
  if (input.empty()) return 0;
  const bool is_text = input.front() == '{' || input.front() == '[';
  const std::string text = is_text ? std::string(input) : rig_of_choices(Choices(input));
  answered([&] { static_cast<void>(devices_from_text(text)); });
  answered([&] {
    const Rig rig = rig_from_text(text);
    // What was read is written so that it can be read again, to the same bytes.
    const std::string written = rig_text(rig);
    if (rig_text(rig_from_text(written)) != written) std::abort();
    look_at(rig);
  });
  return 0;
}
