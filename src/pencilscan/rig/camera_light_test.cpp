#include "pencilscan/rig/camera_light.h"

#include <gtest/gtest.h>

#include "pencilscan/core/error.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

/// Random samples, some of them at the top of the range.
cv::Mat stored_image(int type, const cv::Size& size) {
  cv::Mat image(size, type);
  const double top = image.depth() == CV_8U ? 255 : 65535;
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, 1.05 * top);  // cut at the top
  return image;
}

class StoredImages : public testing::TestWithParam<int> {};

TEST_P(StoredImages, AreLightLikeTheirValues) {
  Camera camera = sample::small_rig(64, 48, 11).cameras.front();
  camera.gamma = 2.2;
  camera.black_level = 0.02;
  if (CV_MAT_CN(GetParam()) == 1) camera.mosaic = Mosaic::from_name("RGGB");
  const cv::Mat stored = stored_image(GetParam(), {camera.width, camera.height});
  const cv::Mat values = camera_values(camera, stored);
  EXPECT_EQ(values.depth(), CV_32F);
  EXPECT_EQ(cv::norm(linear_light(camera, stored), linear_light(camera, values), cv::NORM_INF), 0);
  const cv::Mat full = overexposed(stored);
  EXPECT_GT(cv::countNonZero(full), 0);
  EXPECT_LT(cv::countNonZero(full), static_cast<int>(full.total()));
  EXPECT_EQ(cv::norm(full, overexposed(values), cv::NORM_INF), 0);
}

INSTANTIATE_TEST_SUITE_P(Types, StoredImages,
                         testing::Values(CV_8UC3, CV_16UC3, CV_8UC1, CV_16UC1));

/// Light of another renderer may have glints; values up to 255 are no light in [0, 1].
TEST(PicturesOfFloatingPoint, HaveValuesUpToOne) {
  const TemporaryFolder folder("float_pictures");
  Camera camera;
  camera.width = 40;
  camera.height = 30;
  const std::filesystem::path path = folder.path() / "cam0.tiff";
  cv::Mat picture(camera.height, camera.width, CV_32FC3, cv::Scalar::all(0.4));
  picture.at<cv::Vec3f>(3, 4) = {3, 3, 3};
  write_image(path, picture);
  EXPECT_NO_THROW(check_camera_image(camera, path));
  write_image(path, cv::Mat(255 * picture));
  EXPECT_THROW(check_camera_image(camera, path), InputError);
  EXPECT_THROW((void)read_camera_image(camera, path), InputError);
}

/// Pictures whose black was taken out have noise around 0; those from -1 to 1 are no light.
TEST(PicturesOfFloatingPoint, AreNotNegativeButForNoise) {
  const TemporaryFolder folder("negative_pictures");
  Camera camera;
  camera.width = 40;
  camera.height = 30;
  const std::filesystem::path path = folder.path() / "cam0.tiff";
  cv::Mat noise(camera.height, camera.width, CV_32FC1);
  cv::RNG(1).fill(noise, cv::RNG::NORMAL, 0, 0.03);
  write_image(path, noise);
  EXPECT_NO_THROW((void)read_camera_image(camera, path));
  cv::Mat centred(camera.height, camera.width, CV_32FC1);
  cv::RNG(1).fill(centred, cv::RNG::UNIFORM, -1, 1);
  centred.at<float>(0, 0) = -1;
  write_image(path, centred);
  try {
    (void)read_camera_image(camera, path);
    FAIL() << "values below 0 were taken for light";
  } catch (const InputError& error) {
    EXPECT_EQ(error.path, path.string());
    EXPECT_EQ(error.value, "-1");
  }
}

/// One that is stuck at the top of 16 bits does not hide that the others have 12.
TEST(SensorRange, IsThatOfAllPixelsButFew) {
  cv::Mat stored(480, 640, CV_16UC1);
  cv::RNG(1).fill(stored, cv::RNG::UNIFORM, 0, 4096);
  EXPECT_EQ(sensor_range(stored), 4095. / 65535);
  stored.at<std::uint16_t>(100, 200) = 65535;
  EXPECT_EQ(sensor_range(stored), 4095. / 65535);
  stored.row(100).setTo(30000);
  EXPECT_EQ(sensor_range(stored), 1);
  EXPECT_EQ(sensor_range(cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(3))), 1);
}

}  // namespace
}  // namespace pencilscan
