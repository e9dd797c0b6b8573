#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/exchange/opencv_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/rig/devices_file.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class Exchange : public ::testing::Test {
 protected:
  void SetUp() override {
    rig_ = sample::small_rig(640, 480, 100);
    rig_.cameras[0].distortion = {-0.1, 0.07, 1e-3, -2e-3, 0.02};
    rig_.cameras[1].distortion = {-0.2, 0.03, 0, 0, 0};
    rig_.projectors[1].K(1, 2) = 700.25;  // lens shift beyond the panel
  }

  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  /// What importing throws says this.
  template <class Call>
  static void expect_bad(Call call, const std::string& part) {
    try {
      call();
      ADD_FAILURE() << "accepted; expected: " << part;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(part));
    }
  }

  std::vector<Device> devices() const {
    return {rig_.cameras[0], rig_.cameras[1], rig_.projectors[0], rig_.projectors[1]};
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path folder_ = temporary_.path();
  Rig rig_;
};

/// Tolerances: 0 where texts hold all digits; rotations pass through a quaternion.
void expect_equal(const Device& a, const Device& b, double tolerance) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_LE((a.K - b.K).norm(), tolerance * 1e3);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_LE(std::abs(a.distortion[i] - b.distortion[i]), 0);
  EXPECT_LE((a.device_from_world.rotation - b.device_from_world.rotation).norm(), tolerance);
  EXPECT_LE((a.device_from_world.translation - b.device_from_world.translation).norm(),
            tolerance * 1e3);
}

UncalibratedRig joined(const ExchangedRig& files, const ExchangeOptions& options = {}) {
  ExchangedRig marked = files;
  for (ExchangedDevice& d : marked.devices)
    d.is_projector = d.is_projector || d.device.name.starts_with("proj");
  return join_rig(marked, {}, options);
}

TEST_F(Exchange, OpencvFilesOfAllDevicesGiveTheSameRig) {
  for (const OpencvSyntax syntax : {OpencvSyntax::kYaml, OpencvSyntax::kXml}) {
    ExchangedRig files;
    for (const Device& device : devices()) {
      const fs::path path = write(device.name + (syntax == OpencvSyntax::kXml ? ".xml" : ".yml"),
                                  opencv_text(device, syntax));
      read_opencv(path, {}, files);
    }
    const UncalibratedRig back = joined(files);
    ASSERT_EQ(back.rig.cameras.size(), 2U);
    ASSERT_EQ(back.rig.projectors.size(), 2U);
    expect_equal(back.rig.cameras[0], rig_.cameras[0], 0);
    expect_equal(back.rig.cameras[1], rig_.cameras[1], 0);
    expect_equal(back.rig.projectors[1], rig_.projectors[1], 0);
    write_devices(back, folder_ / "rig.json");
    EXPECT_EQ(read_rig(folder_ / "rig.json").cameras.size(), 2U);
  }
}

TEST_F(Exchange, StereoFilesJoinRoundTheRig) {
  ExchangedRig files;
  const auto pair = [&](const Device& a, const Device& b, const std::string& name) {
    read_opencv(write(name, opencv_stereo_text(a, b, OpencvSyntax::kYaml)), {}, files);
  };
  pair(rig_.cameras[0], rig_.projectors[0], "a.yml");
  pair(rig_.cameras[1], rig_.projectors[1], "b.yml");  // joined by the next one only
  pair(rig_.projectors[0], rig_.cameras[1], "c.yml");
  const UncalibratedRig back = joined(files);
  for (const GivenCalibration& given : back.given) EXPECT_TRUE(given.pose);
  // The first device is the world.
  const RigidTransform world = rig_.cameras[0].device_from_world.inverse();
  const RigidTransform expected = rig_.projectors[1].device_from_world * world;
  EXPECT_LT((back.rig.projectors[1].device_from_world.translation - expected.translation).norm(),
            1e-9);
  EXPECT_LT((back.rig.projectors[1].device_from_world.rotation - expected.rotation).norm(), 1e-12);
}

TEST_F(Exchange, AFileOfRAndTAloneJoinsTheDevicesThatItIsGiven) {
  const auto without = [](std::string text, const std::vector<std::string>& keys) {
    for (const std::string& key : keys) text.replace(text.find("\n" + key + ":") + 1, 1, "q");
    return text;
  };
  const Camera& camera = rig_.cameras[0];
  const Projector& projector = rig_.projectors[0];
  const fs::path step =
      write("extrinsics.yml", without(opencv_stereo_text(camera, projector, OpencvSyntax::kYaml),
                                      {"K1", "K2", "D1", "D2"}));
  for (const bool is_first : {true, false}) {
    ExchangedRig files;
    if (is_first) read_opencv(step, {camera.name, projector.name}, files);
    for (const Device* device :
         {static_cast<const Device*>(&camera), static_cast<const Device*>(&projector)}) {
      const std::string text = without(opencv_text(*device, OpencvSyntax::kYaml), {"R", "T"});
      read_opencv(write(device->name + ".yml", text), {}, files);
    }
    if (!is_first) read_opencv(step, {camera.name, projector.name}, files);
    const UncalibratedRig back = joined(files);
    ASSERT_EQ(back.given.size(), 2U);
    for (const GivenCalibration& given : back.given) EXPECT_TRUE(given.K && given.pose);
    const RigidTransform expected =
        projector.device_from_world * camera.device_from_world.inverse();
    EXPECT_LT((back.rig.projectors[0].device_from_world.translation - expected.translation).norm(),
              1e-9);
  }
  ExchangedRig nameless;
  expect_bad([&] { read_opencv(step, {}, nameless); }, "give the names of their two devices");
}

TEST_F(Exchange, UsualSpellingsAreRead) {
  // A stereo calibration as OpenCV's sample writes it, in metres, without sizes.
  const fs::path sample = write("stereo.yml", R"(%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ 0.1, 0.2, 0.3, 0.4 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 600., 0., 320., 0., 601., 240., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.25, 0., 0. ]
)");
  // ROS' camera_info: no signature, plain rows, cols, data.
  const fs::path ros = write("info.yaml", R"(image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [700, 0, 320, 0, 701, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.03]
)");
  ExchangedRig files;
  read_opencv(sample, {"cam0", "proj0"}, files);
  read_opencv(ros, {}, files);
  EXPECT_EQ(files.devices[2].device.name, "head");
  EXPECT_EQ(files.devices[2].device.distortion[4], 0.03);
  expect_bad([&] { (void)joined(files); }, "image size of cam0");
  for (ExchangedDevice& d : files.devices) {
    d.device.width = 640;
    d.device.height = 480;
  }
  ExchangeOptions metres;
  metres.mm_per_unit = 1000;
  const UncalibratedRig rig = joined(files, metres);
  EXPECT_EQ(rig.rig.projectors[0].device_from_world.translation, Vec3(-250, 0, 0));
  EXPECT_EQ(rig.rig.cameras[0].distortion[3], 0.4);
  EXPECT_FALSE(rig.given[1].pose);  // head: nobody says where it stands
}

TEST_F(Exchange, CoefficientsOfOtherLensModelsAreRefused) {
  for (const char* model : {"distortion_model: equidistant", "camera_model: omni", "xi: 1.2",
                            "fisheye_model: 1", "distortion_model: plumb_bob"}) {
    const fs::path file =
        write("lens.yml", std::string("image_width: 640\nimage_height: 480\n") + model +
                              "\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
                              "  data: [700, 0, 320, 0, 701, 240, 0, 0, 1]\n");
    ExchangedRig files;
    const auto read = [&] { read_opencv(file, {}, files); };
    if (std::string(model).ends_with("plumb_bob")) {
      EXPECT_NO_THROW(read());
    } else {
      expect_bad(read, "must be a pinhole with k1 k2 p1 p2 k3");
    }
  }
}

TEST_F(Exchange, OmnidirectionalPairsAreRefused) {
  const auto matrix = [](const std::string& key, int rows, int cols, const std::string& data) {
    return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
           "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: [" + data + "]\n";
  };
  std::string pair = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n";
  for (const char* k : {"1", "2"}) {
    pair += matrix(std::string("camera_matrix_") + k, 3, 3, "700,0,320,0,701,240,0,0,1");
    pair += matrix(std::string("distortion_coefficients_") + k, 1, 4, "-0.3,0.1,0,0");
  }
  ExchangedRig files;
  EXPECT_NO_THROW(read_opencv(write("pair.yml", pair), {}, files));
  for (const char* key : {"xi_1", "xi2"}) {
    ExchangedRig others;
    const fs::path file = write("omni.yml", pair + matrix(key, 1, 1, "1.2"));
    expect_bad([&] { read_opencv(file, {}, others); }, "must be a pinhole with k1 k2 p1 p2 k3");
  }
}

TEST_F(Exchange, BaseKeepsPatternsAndTakesValuesOver) {
  Device found = rig_.cameras[0];
  found.K(0, 0) = 911;
  ExchangedRig files;
  read_opencv(write("cam0.yml", opencv_text(found, OpencvSyntax::kYaml)), {}, files);
  UncalibratedRig base{rig_, std::vector<GivenCalibration>(4)};
  const UncalibratedRig result = join_rig(files, base);
  EXPECT_EQ(result.rig.cameras.size(), 2U);
  EXPECT_EQ(result.rig.cameras[0].K(0, 0), 911);
  EXPECT_TRUE(result.given[0].K);
  EXPECT_FALSE(result.given[1].K);
  EXPECT_EQ(result.rig.projectors[0].patterns.size(), 1U);
  base.rig.cameras[0].width = 320;
  expect_bad([&] { (void)join_rig(files, base); }, "must be that of --base, 320 x 480");
}

TEST_F(Exchange, ARationalLensComesBackWhole) {
  rig_.cameras[0].distortion = {-0.3, 0.1, 1e-3, -2e-3, 0.02, 0.25, -0.04, 0.01};
  ExchangedRig files;
  read_opencv(write("lens.yml", opencv_text(rig_.cameras[0], OpencvSyntax::kYaml)), {}, files);
  EXPECT_EQ(files.devices[0].device.distortion, rig_.cameras[0].distortion);
  write_rig(rig_, folder_ / "rational.json");
  EXPECT_EQ(read_rig(folder_ / "rational.json").cameras[0].distortion, rig_.cameras[0].distortion);
  write_colmap(rig_, {}, folder_ / "model");
  const ExchangedRig model = read_colmap(folder_ / "model");
  EXPECT_EQ(model.devices[0].device.distortion, rig_.cameras[0].distortion);
}

TEST_F(Exchange, AThinPrismBecomesTheNearestBrownLens) {
  Device device = rig_.cameras[0];
  const LensModel mild = thin_prism_lens({-0.1, 0.05, 1e-3, 0, 0, 0.02, -0.01, 0, 0, 0, 0, 0});
  const BrownFit fit = fit_brown(device, mild);
  EXPECT_LT(fit.worst_px, 0.05);
  EXPECT_GT(fit.worst_px, 0);
  // d x' / d k1 is r^2 x of both: k1 - k4 leads.
  EXPECT_NEAR(fit.distortion[0], -0.12, 0.01);
  ExchangedRig files;
  std::string text = opencv_text(device, OpencvSyntax::kYaml);
  const auto at = text.find("cols: 5");
  text.replace(at, 7, "cols: 12");
  const auto data = text.find("data: [", at);
  text.replace(data, text.find(']', data) - data,
               "data: [ 0., 0., 0., 0., 0., 0., 0., 0., 9., 0., 0., 0. ");
  read_opencv(write("wild.yml", text), {}, files);
  expect_bad([&] { (void)joined(files); }, "must reproduce its lens");
}

TEST_F(Exchange, OpencvFilesMayBeginWithAMarkAndHoldTheSizeAsAMatrix) {
  std::string text = opencv_text(rig_.cameras[0], OpencvSyntax::kYaml);
  text.erase(0, text.find("camera_name"));  // as ROS writes it, and a Windows editor
  ExchangedRig files;
  read_opencv(write("ros.yml", "\xEF\xBB\xBF" + text), {}, files);
  EXPECT_EQ(files.devices[0].device.name, rig_.cameras[0].name);
  const auto at = text.find("image_width");
  text.replace(at, text.find("camera_matrix") - at,
               "image_size: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: i\n"
               "   data: [ 640, 480 ]\n");
  read_opencv(write("python.yml", text), {}, files);
  EXPECT_EQ(files.devices[1].device.width, 640);
  EXPECT_EQ(files.devices[1].device.height, 480);
}

TEST_F(Exchange, BadOpencvFilesAreNamed) {
  ExchangedRig files;
  const std::string good = opencv_text(rig_.cameras[0], OpencvSyntax::kYaml);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return write("bad.yml", text);
  };
  const auto read = [&](const fs::path& path) {
    return [&, path] { read_opencv(path, {}, files); };
  };
  expect_bad(read(write("bad.yml", "no such thing")), "bad.yml");
  expect_bad(read(write("bad.xml", "<?xml version=\"1.0\"?><opencv_storage><a")), "bad.xml");
  expect_bad(read(write("zero.xml", std::string("<?xml version=\0\0<a>", 20))), "must be text");
  expect_bad(read(write("end.xml", "<?xml version=\n \n")), "must be XML that ends with a tag");
  for (const char* endless : {"%YAML:1.0\n t: d\nncv-\n ", "%YAML:1.0\n--- t: d\nncv-\n ",
                              "%YAML:1.0\n# c\n---\n\n  t: d\n ncv-\n ", " t: d\r\nncv-\n "})
    expect_bad(read(write("endless.yml", endless)), "first key at the beginning of a line");
  expect_bad(read(changed("camera_matrix", "other_matrix")), "camera_matrix");
  expect_bad(read(changed("image_width: 640", "image_width: 0")), "image_width");
  expect_bad(read(changed("cols: 5", "cols: 3")), "distortion_coefficients");
  expect_bad(read(changed("R: ", "Q: ")), "needs a rotation");
  expect_bad(read(changed("data: [ 900., 0., ", "data: [ 900., 2., ")), "knows no skew");
  expect_bad(
      [&] {
        read_opencv(write("two.yml", good), {"a", "b"}, files);
      },
      "must be given 1 name(s)");
  EXPECT_TRUE(files.devices.empty());
}

TEST_F(Exchange, ColmapModelGivesTheSameRig) {
  const std::vector<MeasuredPoint> points{{.x = 1, .y = 2, .z = 3, .u = 10, .v = 20, .camera = 1},
                                          {.x = 4, .y = 5, .z = 6, .u = 11, .v = 21, .camera = 0},
                                          {.x = 7, .y = 8, .z = 9, .u = 12, .v = 22, .camera = 1}};
  write_colmap(rig_, points, folder_);
  const UncalibratedRig back = joined(read_colmap(folder_));
  constexpr double kQuaternion = 1e-14;
  for (std::size_t i = 0; i < 2; ++i) {
    expect_equal(back.rig.cameras[i], rig_.cameras[i], kQuaternion);
    expect_equal(back.rig.projectors[i], rig_.projectors[i], kQuaternion);
  }
  const std::string cameras = read_file(folder_ / "cameras.txt");
  EXPECT_THAT(cameras, HasSubstr("1 FULL_OPENCV 640 480 900 900 320.5 240.5 -0.1"));
  EXPECT_THAT(cameras, HasSubstr("2 OPENCV"));
  EXPECT_THAT(cameras, HasSubstr("4 PINHOLE 640 512 1000 1000 320.5 700.75"));
  EXPECT_THAT(read_file(folder_ / "images.txt"), HasSubstr("10.5 20.5 1 12.5 22.5 3 \n"));
  EXPECT_THAT(read_file(folder_ / "points3D.txt"), HasSubstr("3 7 8 9 160 160 160 0 2 1\n"));
}

TEST_F(Exchange, ColmapProjectsWhereTheRigDoes) {
  // COLMAP's PINHOLE by its own definition, from the text alone: x = f X / Z + c, the first pixel's
  // centre at one half.
  rig_.cameras[0].distortion = {};
  write_colmap(rig_, {}, folder_);
  std::istringstream camera(read_file(folder_ / "cameras.txt"));
  std::string line;
  std::getline(camera, line);
  int id = 0, width = 0, height = 0;
  std::string model;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  camera >> id >> model >> width >> height >> fx >> fy >> cx >> cy;
  std::istringstream image(read_file(folder_ / "images.txt"));
  std::getline(image, line);
  double w = 0, x = 0, y = 0, z = 0;
  Vec3 t;
  image >> id >> w >> x >> y >> z >> t.x() >> t.y() >> t.z();
  const Vec3 world(12, -30, 40);
  const Vec3 local = Eigen::Quaterniond(w, x, y, z) * world + t;
  const Vec2 in_colmap(fx * local.x() / local.z() + cx, fy * local.y() / local.z() + cy);
  const Vec2 ours = *rig_.cameras[0].project(world);
  EXPECT_LT((in_colmap - ours - Vec2(0.5, 0.5)).norm(), 1e-9);
}

TEST_F(Exchange, OtherColmapModelsAndBadLines) {
  write("images.txt", "1 1 0 0 0 0 0 5 7 views/a.jpg\n\n2 1 0 0 0 1 0 5 7 views/proj.jpg\n3 4 1\n");
  write("cameras.txt", "# comment\n7 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n");
  const ExchangedRig files = read_colmap(folder_);
  ASSERT_EQ(files.devices.size(), 2U);
  EXPECT_EQ(files.devices[0].device.name, "views_a");
  EXPECT_EQ(files.devices[0].device.K(1, 2), 39.5);
  EXPECT_EQ(files.devices[0].device.distortion[0], -0.1);
  const auto read = [&] { (void)read_colmap(folder_); };
  write("cameras.txt", "7 FISHEYE 100 80 90 50 40 -0.1\n");
  expect_bad(read, "line 1 = FISHEYE");
  write("cameras.txt", "7 PINHOLE 100 80 90 50 40\n");
  expect_bad(read, "3 parameters");
  write("cameras.txt", "8 PINHOLE 100 80 90 90 50 40\n");
  expect_bad(read, "must be a camera of cameras.txt");
  write("cameras.txt", "7 PINHOLE 100 80 90 90 50 nan\n");
  expect_bad(read, "must be a number");
  write("cameras.txt", "7 PINHOLE 100 80 90 90 50 40\n7 PINHOLE 100 80 91 91 50 40\n");
  expect_bad(read, "line 2 = 7: cameras must differ in their CAMERA_ID");
  write("cameras.txt", "7 PINHOLE 100 80 90 90 50 40\n");
  write("images.txt", "1 1 0 0 0 0 0 5 7 a.jpg\n2 1 0 0 0 1 0 5 7 b.jpg\n");
  expect_bad(read, "line 2 = 2: must be the points");
  rig_.cameras[0].name = "front camera";
  expect_bad([&] { write_colmap(rig_, {}, folder_); }, "front camera");
  rig_.cameras[0].name = "cam0";
  rig_.cameras[0].K(0, 1) = 2;
  expect_bad([&] { write_colmap(rig_, {}, folder_); }, "skew");
  expect_bad([&] { (void)opencv_text(rig_.cameras[0], OpencvSyntax::kXml); }, "skew");
}

}  // namespace
}  // namespace pencilscan
