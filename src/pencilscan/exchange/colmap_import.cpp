#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

/// A text file line by line, comments left out.
class ModelFile {
 public:
  explicit ModelFile(const std::filesystem::path& path)
      : path_(path.string()), text_(read_file(path)) {}

  /// The next line that is no comment and not empty; false at the end.
  bool next() {
    while (next_of_any_kind())
      if (!words_.empty() && words_.front().front() != '#') return true;
    return false;
  }
  /// The next line, whatever it holds.
  bool next_of_any_kind() {
    std::string line;
    if (!std::getline(text_, line)) return false;
    ++line_;
    std::istringstream words(line);
    words_.clear();
    for (std::string word; words >> word;) words_.push_back(word);
    return true;
  }

  [[noreturn]] void fail(const std::string& value, const std::string& rule) const {
    throw InputError(path_, "line " + std::to_string(line_), value, rule);
  }
  [[nodiscard]] const std::vector<std::string>& words() const { return words_; }

  [[nodiscard]] double number(std::size_t i) const {
    std::size_t used = 0;
    double value = NAN;
    try {
      value = std::stod(words_[i], &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used != words_[i].size() || !std::isfinite(value)) fail(words_[i], "must be a number");
    return value;
  }
  [[nodiscard]] int whole(std::size_t i, int low, int high) const {
    const double value = number(i);
    if (value != std::floor(value) || value < low || value > high)
      fail(words_[i],
           "must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
    return static_cast<int>(value);
  }

 private:
  std::string path_;
  std::istringstream text_;
  int line_ = 0;
  std::vector<std::string> words_;
};

/// Where a model's parameters stand in its line; -1: not in this model. (COLMAP, "Camera Models".)
struct ModelLayout {
  const char* name;
  std::size_t count;
  int fx, fy, cx, cy;
  std::array<int, Distortion::kCoefficients> distortion;  ///< in its order
};
constexpr std::array<ModelLayout, 6> kLayouts{{
    {"SIMPLE_PINHOLE", 3, 0, 0, 1, 2, {-1, -1, -1, -1, -1, -1, -1, -1}},
    {"PINHOLE", 4, 0, 1, 2, 3, {-1, -1, -1, -1, -1, -1, -1, -1}},
    {"SIMPLE_RADIAL", 4, 0, 0, 1, 2, {3, -1, -1, -1, -1, -1, -1, -1}},
    {"RADIAL", 5, 0, 0, 1, 2, {3, 4, -1, -1, -1, -1, -1, -1}},
    {"OPENCV", 8, 0, 1, 2, 3, {4, 5, 6, 7, -1, -1, -1, -1}},
    {"FULL_OPENCV", 12, 0, 1, 2, 3, {4, 5, 6, 7, 8, 9, 10, 11}},
}};

constexpr int kMostIds = 1 << 30;

/// Camera line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[].
ExchangedDevice parse_camera_line(const ModelFile& file) {
  constexpr std::size_t kHead = 4;
  constexpr int kLargestSide = 1 << 16;
  const auto& words = file.words();
  if (words.size() < kHead) file.fail(words.front(), "must be CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
  const auto* layout = std::find_if(kLayouts.begin(), kLayouts.end(),
                                    [&](const ModelLayout& l) { return words[1] == l.name; });
  if (layout == kLayouts.end())
    file.fail(words[1],
              "must be SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV or FULL_OPENCV");
  if (words.size() != kHead + layout->count)
    file.fail(std::to_string(words.size() - kHead) + " parameters",
              words[1] + " has " + std::to_string(layout->count));
  const auto parameter = [&](int i) { return i < 0 ? 0 : file.number(kHead + std::size_t(i)); };
  ExchangedDevice d;
  d.device.width = file.whole(2, 1, kLargestSide);
  d.device.height = file.whole(3, 1, kLargestSide);
  d.device.K(0, 0) = parameter(layout->fx);
  d.device.K(1, 1) = parameter(layout->fy);
  d.device.K(0, 2) = parameter(layout->cx) - kColmapHalfPixel;
  d.device.K(1, 2) = parameter(layout->cy) - kColmapHalfPixel;
  if (!(d.device.K(0, 0) > 0) || !(d.device.K(1, 1) > 0))
    file.fail(words[kHead], "focal lengths must be > 0");
  for (std::size_t i = 0; i < layout->distortion.size(); ++i)
    d.device.distortion[i] = parameter(layout->distortion[i]);
  d.given = {true, true, false};
  return d;
}

/// Image line: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME.
RigidTransform parse_pose(const ModelFile& file) {
  constexpr double kLeastNorm = 1e-6;
  const Eigen::Quaterniond q(file.number(1), file.number(2), file.number(3), file.number(4));
  if (!(q.norm() > kLeastNorm)) file.fail(file.words()[1], "the quaternion must not be 0");
  return {q.normalized().toRotationMatrix(), {file.number(5), file.number(6), file.number(7)}};
}

/// The image's path without ending, as one file name.
std::string device_name(const std::string& image) {
  std::string name = std::filesystem::path(image).replace_extension().string();
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

}  // namespace

ExchangedRig read_colmap(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "cameras.txt") &&
      std::filesystem::exists(folder / "cameras.bin"))
    throw InputError(folder.string(), "cameras.bin", "binary",
                     "must be a text model: colmap model_converter --output_type TXT");
  std::map<int, ExchangedDevice> cameras;
  ModelFile camera_file(folder / "cameras.txt");
  while (camera_file.next()) {
    if (!cameras.emplace(camera_file.whole(0, 0, kMostIds), parse_camera_line(camera_file)).second)
      camera_file.fail(camera_file.words().front(), "cameras must differ in their CAMERA_ID");
  }
  ExchangedRig rig;
  rig.world_is_arbitrary = true;
  std::set<std::string> names;
  const std::filesystem::path images = folder / "images.txt";
  ModelFile file(images);
  while (file.next()) {
    constexpr std::size_t kWords = 10;
    if (file.words().size() != kWords)
      file.fail(file.words().front(), "must be IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
    const auto camera = cameras.find(file.whole(8, 0, kMostIds));
    if (camera == cameras.end()) file.fail(file.words()[8], "must be a camera of cameras.txt");
    ExchangedDevice& d = rig.devices.emplace_back(camera->second);
    d.source = images.string();
    d.device.name = device_name(file.words()[9]);
    if (!names.insert(d.device.name).second)
      file.fail(file.words()[9], "names without ending must differ from each other");
    d.device.device_from_world = parse_pose(file);
    d.given.pose = true;
    constexpr std::size_t kPointWords = 3;
    if (file.next_of_any_kind() && file.words().size() % kPointWords != 0)
      file.fail(file.words().front(),
                "must be the points that the image before sees, X Y "
                "POINT3D_ID each, or empty: an image has two lines");
  }
  if (rig.devices.empty()) throw InputError(images.string(), "", "", "must hold an image");
  return rig;
}

}  // namespace pencilscan
