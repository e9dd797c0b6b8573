#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <string_view>

#include "pencilscan/core/byte_order_mark.h"
#include "pencilscan/core/error.h"
#include "pencilscan/exchange/opencv_file.h"
#include "pencilscan/geometry/rotation.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

constexpr int kLargestSide = 1 << 16;  ///< px

/// True where the first key of a YAML text stands at the beginning of its line. Of a text that is
/// indented as a whole, OpenCV's parser reads what follows less indented for ever.
bool begins_in_first_column(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const bool is_mark = line.starts_with("---");
    const std::string_view rest = is_mark ? line.substr(3) : line;
    const auto first = rest.find_first_not_of(kBlanks);
    if (first == std::string_view::npos || rest[first] == '#' || line.starts_with("%")) continue;
    return !is_mark && first == 0;
  }
  return true;
}

/// One file; complaints name it.
class OpencvReader {
 public:
  explicit OpencvReader(const std::filesystem::path& path) : path_(path.string()) {
    std::string text = without_byte_order_mark(read_file(path));
    // OpenCV's parser of XML follows a null pointer where the text ends, or a byte 0 stands, behind
    // the = of an attribute.
    if (text.find('\0') != std::string::npos)
      fail("", "", "must be text: it holds bytes of value 0");
    const auto last =
        std::find_if(text.rbegin(), text.rend(), [](unsigned char c) { return c > ' '; });
    if (text.starts_with("<?xml") && *last != '>') fail("", "", "must be XML that ends with a tag");
    // YAML of other programs lacks the line that OpenCV asks for.
    const bool has_signature =
        text.starts_with("%YAML") || text.starts_with("<?xml") || text.starts_with("{");
    if (!has_signature) text = "%YAML:1.0\n---\n" + text;
    if (text.starts_with("%YAML") && !begins_in_first_column(text))
      fail("", "", "must have its first key at the beginning of a line");
    try {
      storage_.open(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    } catch (const std::exception&) {  // OpenCV's own, and what its parser runs into
      storage_.release();
    }
    if (!storage_.isOpened() || !storage_.root().isMap())
      fail("", "", "must be YAML or XML as OpenCV's FileStorage writes it");
  }

  [[noreturn]] void fail(const std::string& field, const std::string& value,
                         const std::string& rule) const {
    throw InputError(path_, field, value, rule);
  }
  [[nodiscard]] const std::string& path() const { return path_; }

  /// The first of the keys that the file has.
  [[nodiscard]] cv::FileNode find(const std::vector<std::string>& keys) const {
    for (const std::string& key : keys) {
      const cv::FileNode node = storage_[key];
      if (!node.empty()) return node;
    }
    return {};
  }

  /// A matrix, ROS' rows/cols/data, or a list of numbers (a column) or of rows.
  [[nodiscard]] Eigen::MatrixXd matrix(const cv::FileNode& node) const {
    std::vector<double> values;
    Eigen::Index rows = 0;
    if (node.isMap() && !node["data"].empty()) {
      collect(node["data"], node.name(), values);
      rows = static_cast<int>(node["rows"]);
      const auto columns = static_cast<std::size_t>(static_cast<int>(node["cols"]));
      if (values.size() != static_cast<std::size_t>(rows) * columns)
        fail(node.name(), std::to_string(values.size()) + " numbers", "must be rows * cols");
    } else if (node.isSeq()) {
      collect(node, node.name(), values);
      rows = static_cast<Eigen::Index>(node.size());
    } else {
      fail(node.name(), "", "must be a matrix");
    }
    const auto count = static_cast<Eigen::Index>(values.size());
    if (rows < 1 || count == 0 || count % rows != 0)
      fail(node.name(), std::to_string(count) + " numbers",
           "must fill " + std::to_string(rows) + " rows");
    return Eigen::Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(values.data(), rows,
                                                                      count / rows);
  }

  [[nodiscard]] Mat3 camera_matrix(const cv::FileNode& node) const {
    const Eigen::MatrixXd K = matrix(node);
    if (K.rows() != 3 || K.cols() != 3 || !(K(0, 0) > 0) || !(K(1, 1) > 0) || K(1, 0) != 0 ||
        K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1)
      fail(node.name(), "", "must be 3x3, [fx 0 cx; 0 fy cy; 0 0 1] with fx, fy > 0");
    if (K(0, 1) != 0)
      fail(node.name(), std::to_string(K(0, 1)), "OpenCV knows no skew: K[0][1] must be 0");
    return K;
  }

  /// k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]].
  /// An empty list is a lens without distortion.
  void read_distortion(const cv::FileNode& node, ExchangedDevice& d) const {
    if (node.isSeq() && node.empty()) return;
    const Eigen::MatrixXd D = matrix(node);
    const Eigen::Index count = D.size();
    constexpr std::array<Eigen::Index, 5> kCounts{4, 5, 8, 12, 14};
    if ((D.rows() != 1 && D.cols() != 1) ||
        std::find(kCounts.begin(), kCounts.end(), count) == kCounts.end())
      fail(node.name(), std::to_string(count) + " numbers",
           "must be k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]");
    if (count == 14 && (D(12) != 0 || D(13) != 0))
      fail(node.name(), "tilted sensor", "tx and ty must be 0");
    std::array<double, 12> all{};
    std::copy_n(D.data(), std::min<Eigen::Index>(count, 12), all.begin());
    auto& k = d.device.distortion.k;
    std::copy_n(all.begin(), k.size(), k.begin());
    if (std::any_of(all.begin() + k.size(), all.end(), [](double c) { return c != 0; }))
      d.lens = thin_prism_lens(all);
    d.given.distortion = true;
  }

  /// R and T by any of these keys; nothing when there is neither.
  [[nodiscard]] std::optional<RigidTransform> pose(const std::vector<std::string>& rotations,
                                                   const std::vector<std::string>& shifts) const {
    const cv::FileNode rotation = find(rotations);
    const cv::FileNode shift = find(shifts);
    if (rotation.empty() && shift.empty()) return std::nullopt;
    if (rotation.empty()) fail(shift.name(), "", "needs a rotation beside it (R)");
    if (shift.empty()) fail(rotation.name(), "", "needs a translation beside it (T)");
    const Eigen::MatrixXd R = matrix(rotation);
    const Eigen::MatrixXd T = matrix(shift);
    if (T.size() != 3) fail(shift.name(), std::to_string(T.size()) + " numbers", "must have 3");
    RigidTransform result;
    result.translation = Vec3(T(0), T(1), T(2));
    if (R.size() == 3) {
      cv::Mat full;
      cv::Rodrigues(cv::Vec3d(R(0), R(1), R(2)), full);
      cv::cv2eigen(full, result.rotation);
      return result;
    }
    if (R.rows() != 3 || R.cols() != 3 || rotation_error(R) > kRotationTolerance ||
        Mat3(R).determinant() < 0)
      fail(rotation.name(), "",
           "must be a rotation: 3x3 with entries of |R R' - I| <= 1e-4, or 3 numbers");
    result.rotation = R;
    return result;
  }

  /// Width and height from two keys, or from one with both; 0 when missing.
  void read_size(const std::vector<std::string>& widths, const std::vector<std::string>& heights,
                 const std::vector<std::string>& both, Device& device) const {
    const cv::FileNode width = find(widths);
    const cv::FileNode height = find(heights);
    const cv::FileNode size = find(both);
    if (!width.empty() && !height.empty()) {
      device.width = side(width);
      device.height = side(height);
    } else if (size.isSeq() && size.size() == 2) {
      device.width = side(size[0]);
      device.height = side(size[1]);
    } else if (const cv::FileNode data = size.isMap() ? size["data"] : cv::FileNode();
               data.isSeq() && data.size() == 2) {  // Python can only write it as a matrix
      device.width = side(data[0]);
      device.height = side(data[1]);
    }
  }

  [[nodiscard]] std::string text(const std::vector<std::string>& keys) const {
    const cv::FileNode node = find(keys);
    return node.isString() ? static_cast<std::string>(node) : std::string();
  }

 private:
  void collect(const cv::FileNode& node, const std::string& field,
               std::vector<double>& values) const {
    for (const cv::FileNode& entry : node) {
      if (entry.isSeq()) {
        collect(entry, field, values);
        continue;
      }
      if (!entry.isReal() && !entry.isInt()) fail(field, "", "must hold numbers only");
      values.push_back(static_cast<double>(entry));
      if (!std::isfinite(values.back()))
        fail(field, std::to_string(values.back()), "must be finite");
    }
  }
  [[nodiscard]] int side(const cv::FileNode& node) const {
    const double value = node.isInt() || node.isReal() ? static_cast<double>(node) : 0;
    if (!(value >= 1 && value <= kLargestSide) || value != std::floor(value))
      fail(node.name(), std::to_string(value), "must be a whole number from 1 to 65536");
    return static_cast<int>(value);
  }

  std::string path_;
  cv::FileStorage storage_;
};

/// The spellings of a stereo file's keys for one of its devices.
struct StereoKeys {
  const char* name;
  bool is_projector;
  std::vector<std::string> K;
  std::vector<std::string> distortion;
  std::vector<std::string> size;
};

const std::vector<std::array<StereoKeys, 2>>& stereo_spellings() {
  static const std::vector<std::array<StereoKeys, 2>> kSpellings{
      {{{"cam0",
         false,
         {"K1", "cameraMatrix1", "camera_matrix1", "camera_matrix_1", "M1", "left_camera_matrix"},
         {"D1", "distCoeffs1", "dist_coeffs1", "distortion_coefficients1",
          "distortion_coefficients_1", "left_distortion_coefficients"},
         {"image_size1"}},
        {"cam1",
         false,
         {"K2", "cameraMatrix2", "camera_matrix2", "camera_matrix_2", "M2", "right_camera_matrix"},
         {"D2", "distCoeffs2", "dist_coeffs2", "distortion_coefficients2",
          "distortion_coefficients_2", "right_distortion_coefficients"},
         {"image_size2"}}}},
      {{{"cam0", false, {"cam_K", "cam_int", "camera_K"}, {"cam_kc", "cam_dist"}, {"img_shape"}},
        {"proj0", true, {"proj_K", "proj_int", "projector_K"}, {"proj_kc", "proj_dist"}, {}}}}};
  return kSpellings;
}

/// Refuses other lens models, whose coefficients would be read as k1 k2 p1 p2.
void refuse_other_models(const OpencvReader& file) {
  constexpr const char* kRule = "must be a pinhole with k1 k2 p1 p2 k3";
  constexpr std::array kOtherModels = {
      "equidistant", "fisheye", "kannala_brandt", "equi", "omni", "mei", "eucm", "ds", "fov"};
  for (const char* key : {"distortion_model", "camera_model"}) {
    const std::string model = file.text({key});
    if (std::find(kOtherModels.begin(), kOtherModels.end(), model) != kOtherModels.end())
      file.fail(key, model, kRule);
  }
  // Of cv::omnidir and of Mei's model; a file of two cameras has one for each.
  for (const char* key : {"xi", "xi1", "xi2", "xi_1", "xi_2"})
    if (!file.find({key}).empty()) file.fail(key, "", kRule);
  const cv::FileNode fisheye = file.find({"fisheye_model"});
  if (!fisheye.empty() && static_cast<int>(fisheye) != 0)
    file.fail("fisheye_model", std::to_string(static_cast<int>(fisheye)), kRule);
}

std::optional<RigidTransform> read_step(const OpencvReader& file) {
  return file.pose({"R", "rotation", "stereo_R"}, {"T", "translation", "stereo_T"});
}

bool read_stereo(const OpencvReader& file, ExchangedRig& rig) {
  for (const auto& spelling : stereo_spellings()) {
    if (file.find(spelling[0].K).empty() || file.find(spelling[1].K).empty()) continue;
    refuse_other_models(file);
    std::array<std::string, 2> names;
    for (std::size_t k = 0; k < 2; ++k) {
      const StereoKeys& keys = spelling[k];
      ExchangedDevice& d = rig.devices.emplace_back();
      d.source = file.path();
      d.is_projector = keys.is_projector;
      const std::string stated = file.text({"camera_name" + std::to_string(k + 1)});
      d.device.name = names[k] = stated.empty() ? keys.name : stated;
      d.device.K = file.camera_matrix(file.find(keys.K));
      d.given.K = true;
      if (const cv::FileNode D = file.find(keys.distortion); !D.empty()) file.read_distortion(D, d);
      std::vector<std::string> sizes = keys.size;
      if (!keys.is_projector) sizes.insert(sizes.end(), {"image_size", "imageSize", "img_size"});
      file.read_size({keys.is_projector ? "proj_width" : "image_width"},
                     {keys.is_projector ? "proj_height" : "image_height"}, sizes, d.device);
    }
    if (const auto step = read_step(file))
      rig.relative.push_back({names[0], names[1], *step, file.path()});
    return true;
  }
  return false;
}

bool read_single(const OpencvReader& file, ExchangedRig& rig) {
  const cv::FileNode K = file.find({"camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M",
                                    "mtx", "intrinsic_matrix", "intrinsics"});
  if (K.empty()) return false;
  refuse_other_models(file);
  ExchangedDevice& d = rig.devices.emplace_back();
  d.source = file.path();
  d.device.name = file.text({"camera_name", "name"});
  if (d.device.name.empty()) d.device.name = std::filesystem::path(file.path()).stem().string();
  d.device.K = file.camera_matrix(K);
  d.given.K = true;
  const cv::FileNode D =
      file.find({"distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs",
                 "dist_coefs", "dist", "D", "distortion"});
  if (!D.empty()) file.read_distortion(D, d);
  file.read_size({"image_width", "image_Width", "width"},
                 {"image_height", "image_Height", "height"},
                 {"image_size", "imageSize", "img_size", "size"}, d.device);
  const auto pose = file.pose({"R", "rotation", "rotation_matrix", "rvec"},
                              {"T", "t", "translation", "translation_vector", "tvec"});
  if (pose) {
    d.device.device_from_world = *pose;
    d.given.pose = true;
  }
  return true;
}

/// R and T of a pair whose K stand in other files, as OpenCV's own sample of stereo calibration
/// writes them.
bool read_extrinsics(const OpencvReader& file, const std::vector<std::string>& names,
                     ExchangedRig& rig) {
  const auto step = read_step(file);
  if (!step) return false;
  if (names.size() != 2) {
    file.fail("camera_matrix", "missing",
              "R and T stand alone: give the names of their two devices, NAME,NAME=FILE, beside "
              "the files of K");
  }
  for (const std::string& name : names) {
    ExchangedDevice& d = rig.devices.emplace_back();
    d.source = file.path();
    d.device.name = name;
  }
  rig.relative.push_back({names[0], names[1], *step, file.path()});
  return true;
}

}  // namespace

void read_opencv(const std::filesystem::path& path, const std::vector<std::string>& names,
                 ExchangedRig& rig) {
  const OpencvReader file(path);
  ExchangedRig found;
  if (!read_stereo(file, found) && !read_single(file, found) &&
      !read_extrinsics(file, names, found)) {
    file.fail("camera_matrix", "missing",
              "must hold camera_matrix, K1 and K2 of a stereo calibration, or R and T of one");
  }
  if (!names.empty() && names.size() != found.devices.size())
    throw InputError(
        "command line", "--opencv", path.string(),
        "must be given " + std::to_string(found.devices.size()) + " name(s), as NAME[,NAME]=FILE");
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (RelativePose& pair : found.relative) (i == 0 ? pair.first : pair.second) = names[i];
    found.devices[i].device.name = names[i];
  }
  for (ExchangedDevice& d : found.devices) rig.devices.push_back(std::move(d));
  for (RelativePose& pair : found.relative) rig.relative.push_back(std::move(pair));
}

}  // namespace pencilscan
