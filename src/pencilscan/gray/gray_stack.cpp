#include "pencilscan/gray/gray_stack.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/pattern/solid_color.h"
#include "pencilscan/rig/camera_light.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// Files 000, 001, ... without a gap.
std::vector<fs::path> numbered_files(const fs::path& folder) {
  std::vector<fs::path> files;
  while (const auto file = find_image(folder, gray_code_file_stem(files.size())))
    files.push_back(*file);
  return files;
}

/// Sub-folders by name, and nothing of what begins with a dot.
std::vector<std::string> folders_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && !name.starts_with('.')) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

template <typename DeviceT>
std::size_t index_of(const std::vector<DeviceT>& devices, const std::string& name) {
  const auto found = std::find_if(devices.begin(), devices.end(),
                                  [&](const DeviceT& d) { return d.name == name; });
  return static_cast<std::size_t>(found - devices.begin());
}

/// The first number that is missing and, where nothing is named so, what there is instead.
std::string what_is_missing(const fs::path& folder, const std::vector<fs::path>& files) {
  const std::string missing = gray_code_file_stem(files.size()) + ".png is missing";
  return files.empty() ? missing + ", " + holdings(folder) : missing;
}

/// "cam0, cam1".
template <typename DeviceT>
std::string names_of(const std::vector<DeviceT>& devices) {
  std::string names;
  for (const DeviceT& device : devices) add_name(names, device.name);
  return names;
}

/// The range of the pictures' values, by some that are bright in whatever order they are.
double range_of(const std::vector<fs::path>& files) {
  constexpr std::size_t kBright = 4;
  double range = 0;
  for (std::size_t i = 0; i < std::min(kBright, files.size()); ++i)
    range = std::max(range, sensor_range(read_stored_image(files[i])));
  return range;
}

CapturePair capture_pair(const fs::path& folder, const Projector& projector) {
  CapturePair pair;
  pair.folder = folder;
  pair.files = numbered_files(folder);
  for (const SolidImage& image : solid_images())
    if (const auto file = find_image(folder, image.name)) pair.solids[image.name] = *file;
  const auto bits =
      static_cast<std::size_t>(gray_code_bits(projector.width) + gray_code_bits(projector.height));
  pair.inverses = pair.files.size() == 2 + 2 * bits;
  if (!pair.inverses && pair.files.size() != 2 + bits) {
    throw InputError(
        folder.string(), "images 000, 001, ... without a gap", std::to_string(pair.files.size()),
        "must be " + std::to_string(2 + 2 * bits) + " (or " + std::to_string(2 + bits) +
            " without inverses) for a panel of " + size_text(projector.width, projector.height) +
            " px; " + what_is_missing(folder, pair.files));
  }
  pair.range = range_of(pair.files);
  return pair;
}

}  // namespace

cv::Mat read_color_image(const CapturePair& pair, const fs::path& path, const Camera& camera) {
  const cv::Mat stored = read_stored_image(path);
  check_channels(camera, stored.channels(), path);
  check_light(stored, path);
  cv::Mat color = camera_values(camera, stored);
  if (color.cols != camera.width || color.rows != camera.height) {
    throw InputError(
        path.string(), "size", size_text(color.cols, color.rows),
        "must be that of camera " + camera.name + ", " + size_text(camera.width, camera.height));
  }
  color = linearized(color, 1, camera.black_level);
  if (pair.range < 1 && camera.black_level < pair.range)
    color = color * ((1 - camera.black_level) / (pair.range - camera.black_level));
  return camera.mosaic ? demosaiced(color, *camera.mosaic) : color;
}

GrayStack make_gray_stack(int panel_width, int panel_height, bool inverses,
                          const std::function<cv::Mat(std::size_t)>& image) {
  const auto sequence = gray_code_sequence(panel_width, panel_height, inverses);
  GrayStack stack;
  stack.inverses = inverses;
  stack.panel_width = panel_width;
  stack.panel_height = panel_height;
  stack.white = image(0);
  stack.black = image(1);
  stack.difference[0].resize(static_cast<std::size_t>(gray_code_bits(panel_width)));
  stack.difference[1].resize(static_cast<std::size_t>(gray_code_bits(panel_height)));
  const std::size_t step = inverses ? 2 : 1;
  const std::size_t bits = (sequence.size() - 2) / step;
  parallel_for(bits, [&](std::size_t i) {
    const std::size_t at = 2 + i * step;
    const GrayCodeImage& shown = sequence[at];
    cv::Mat& result =
        stack.difference[shown.axis == Axis::kColumn ? 0 : 1][static_cast<std::size_t>(shown.bit)];
    const cv::Mat pattern = image(at);
    result = inverses ? cv::Mat(pattern - image(at + 1))
                      : cv::Mat(2 * pattern - stack.white - stack.black);
  });
  return stack;
}

std::vector<CapturePair> list_captures(const fs::path& captures, const Rig& rig) {
  std::error_code ignored;
  if (!fs::is_directory(captures, ignored)) {
    throw InputError("--captures", "", captures.string(), "must be a folder");
  }
  std::vector<CapturePair> pairs;
  for (const std::string& projector : folders_in(captures)) {
    const std::size_t p = index_of(rig.projectors, projector);
    if (p == rig.projectors.size()) {
      throw InputError((captures / projector).string(), "folder", projector,
                       "must be the name of a projector (" + names_of(rig.projectors) + ")");
    }
    for (const std::string& camera : folders_in(captures / projector)) {
      const std::size_t c = index_of(rig.cameras, camera);
      const fs::path folder = captures / projector / camera;
      if (c == rig.cameras.size()) {
        throw InputError(folder.string(), "folder", camera,
                         "must be the name of a camera (" + names_of(rig.cameras) + ")");
      }
      CapturePair pair = capture_pair(folder, rig.projectors[p]);
      pair.projector = p;
      pair.camera = c;
      pairs.push_back(std::move(pair));
    }
  }
  if (pairs.empty()) {
    throw InputError("--captures", "", captures.string(),
                     "must hold folders <projector>/<camera> with images; " + holdings(captures));
  }
  std::sort(pairs.begin(), pairs.end(), [](const CapturePair& a, const CapturePair& b) {
    return std::pair(a.projector, a.camera) < std::pair(b.projector, b.camera);
  });
  return pairs;
}

cv::Mat read_gray_image(const CapturePair& pair, const Rig& rig, std::size_t image) {
  const Camera& camera = rig.cameras[pair.camera];
  cv::Mat color = read_color_image(pair, pair.files[image], camera);
  // A pattern and its inverse are equally bright at an edge whatever the gamma; that a pattern
  // alone is halfway between black and white there is true of light only.
  if (!pair.inverses) color = linearized(color, camera.gamma);
  cv::Mat grey;
  cv::transform(color, grey, cv::Matx13f(1.F / 3, 1.F / 3, 1.F / 3));
  return grey;
}

GrayStack read_gray_stack(const CapturePair& pair, const Rig& rig) {
  const Projector& projector = rig.projectors[pair.projector];
  return make_gray_stack(projector.width, projector.height, pair.inverses,
                         [&](std::size_t i) { return read_gray_image(pair, rig, i); });
}

}  // namespace pencilscan
