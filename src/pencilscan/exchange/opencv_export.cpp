#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/exchange/opencv_file.h"

namespace pencilscan {
namespace {

cv::FileStorage new_storage(OpencvSyntax syntax) {
  const int format =
      syntax == OpencvSyntax::kXml ? cv::FileStorage::FORMAT_XML : cv::FileStorage::FORMAT_YAML;
  const std::string ending = syntax == OpencvSyntax::kXml ? ".xml" : ".yml";
  return {ending, cv::FileStorage::WRITE | cv::FileStorage::MEMORY | format};
}

cv::Mat camera_matrix(const Device& device) {
  if (device.K(0, 1) != 0)
    throw InputError("rig", "K of " + device.name, std::to_string(device.K(0, 1)),
                     "OpenCV knows no skew: K[0][1] must be 0");
  cv::Mat K;
  cv::eigen2cv(device.K, K);
  return K;
}

cv::Mat coefficients(const Device& device) {
  const std::vector<double> stated = device.distortion.stated();
  return cv::Mat(stated, true).reshape(1, 1);
}

void write_pose(const RigidTransform& pose, cv::FileStorage& storage) {
  cv::Mat R;
  cv::Mat T;
  cv::eigen2cv(pose.rotation, R);
  cv::eigen2cv(pose.translation, T);
  storage << "R" << R << "T" << T;
}

}  // namespace

std::string opencv_text(const Device& device, OpencvSyntax syntax) {
  cv::FileStorage storage = new_storage(syntax);
  storage << "camera_name" << device.name << "image_width" << device.width << "image_height"
          << device.height << "camera_matrix" << camera_matrix(device) << "distortion_coefficients"
          << coefficients(device);
  write_pose(device.device_from_world, storage);
  return storage.releaseAndGetString();
}

std::string opencv_stereo_text(const Device& first, const Device& second, OpencvSyntax syntax) {
  cv::FileStorage storage = new_storage(syntax);
  storage << "camera_name1" << first.name << "camera_name2" << second.name;
  storage << "image_size1" << cv::Size(first.width, first.height) << "image_size2"
          << cv::Size(second.width, second.height);
  storage << "K1" << camera_matrix(first) << "D1" << coefficients(first) << "K2"
          << camera_matrix(second) << "D2" << coefficients(second);
  write_pose(second.device_from_world * first.device_from_world.inverse(), storage);
  return storage.releaseAndGetString();
}

}  // namespace pencilscan
