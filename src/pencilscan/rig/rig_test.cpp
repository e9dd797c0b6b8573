#include "pencilscan/rig/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pattern/de_bruijn.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

Camera ring_camera(const std::string& name, double azimuth, double elevation) {
  Camera camera;
  camera.name = name;
  camera.width = 1280;
  camera.height = 960;
  camera.K << 2300, 0, 639.5, 0, 2300, 479.5, 0, 0, 1;
  const Vec3 eye = 1100 * Vec3(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  camera.device_from_world = look_at(eye, Vec3(10, 20, 30));
  return camera;
}

Rig example_rig() {
  Rig rig;
  for (int i = 0; i < 3; ++i) {
    rig.cameras.push_back(ring_camera("cam" + std::to_string(i), 0.3 + i * 2.1, 0.2 * i));
  }
  rig.cameras[1].distortion = {0.1, -0.2, 1e-3, -1e-4, 0.05};
  rig.cameras[1].gamma = 2.2;
  rig.cameras[2].sees_texture_only = true;
  rig.cameras[0].mosaic = Mosaic::from_name("GBRG");
  rig.cameras[0].black_level = 1.0 / 16;
  for (int i = 0; i < 2; ++i) {
    Projector projector;
    static_cast<Device&>(projector) = ring_camera("proj" + std::to_string(i), 1.3 + i, 0.5);
    rig.projectors.push_back(projector);
  }
  rig.projectors[0].patterns = {LinePattern{}};
  LinePattern rows;
  rows.axis = Axis::kRow;
  rows.colors = {"red", "yellow", "green"};
  rows.alphabet = 3;
  rows.order = 2;
  rows.sequence = {0, 1, 2, 2};
  rows.has_own_sequence = true;
  rows.max_lines = 7;
  LinePattern plain;
  plain.colors = {PatternColor(Rgb{0.9, 1.0 / 3, 0.05})};
  plain.alphabet = 1;
  plain.order = 1;
  plain.sequence = {0};
  rig.projectors[1].patterns = {rows, plain};
  rig.cameras[0].color_matrix = 0.9 * Mat3::Identity();
  rig.cameras[1].color_matrix_by_projector["proj1"] = 0.8 * Mat3::Identity();
  rig.cameras[0].color_registration.colors[0] = {Vec2(0.3, -1.0 / 3), 1.0001};
  rig.projectors[1].color_registration.colors[2] = {Vec2(-0.25, 0), 1};
  rig.projectors[0].output = "HDMI-1";
  rig.volume = Sphere{{1, 2, 3}, 1.0 / 3};
  rig.floor = Floor{{1, 2, -1.0 / 3}, {0, 0, 1}};
  return rig;
}

class RigFile : public ::testing::Test {
 protected:
  /// The error of reading the example with one change.
  std::string error_after(const std::function<void(nlohmann::json&)>& change) {
    write_rig(example_rig(), folder_ / "rig.json");
    nlohmann::json json = read_json(folder_ / "rig.json");
    change(json);
    write_text(folder_ / "rig.json", json.dump());
    try {
      (void)read_rig(folder_ / "rig.json");
    } catch (const InputError& error) {
      EXPECT_EQ(error.path, (folder_ / "rig.json").string());
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return std::string(error.what()).substr(error.path.size() + 2);
    }
    return "accepted";
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  std::filesystem::path folder_ = temporary_.path();
};

void expect_equal(const Device& a, const Device& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.K, b.K);
  EXPECT_EQ(a.distortion, b.distortion);
  EXPECT_EQ(a.device_from_world.rotation, b.device_from_world.rotation);
  EXPECT_EQ(a.device_from_world.translation, b.device_from_world.translation);
}

TEST_F(RigFile, RoundTripGivesTheSameDoubles) {
  const Rig rig = example_rig();
  write_rig(rig, folder_ / "rig.json");
  const Rig back = read_rig(folder_ / "rig.json");
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  ASSERT_EQ(back.projectors.size(), rig.projectors.size());
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera &a = rig.cameras[i], &b = back.cameras[i];
    expect_equal(a, b);
    EXPECT_EQ(a.gamma, b.gamma);
    EXPECT_EQ(a.sees_texture_only, b.sees_texture_only);
    EXPECT_EQ(a.black_level, b.black_level);
    EXPECT_EQ(a.mosaic, b.mosaic);
    EXPECT_EQ(a.color_matrix_for("proj0"), b.color_matrix_for("proj0"));
    EXPECT_EQ(a.color_matrix_for("proj1"), b.color_matrix_for("proj1"));
  }
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    expect_equal(rig.projectors[i], back.projectors[i]);
    EXPECT_EQ(back.projectors[i].output, rig.projectors[i].output);
    ASSERT_EQ(back.projectors[i].patterns.size(), rig.projectors[i].patterns.size());
    for (std::size_t p = 0; p < rig.projectors[i].patterns.size(); ++p) {
      const LinePattern &a = rig.projectors[i].patterns[p], &b = back.projectors[i].patterns[p];
      EXPECT_EQ(a.axis, b.axis);
      EXPECT_EQ(a.colors, b.colors);
      EXPECT_EQ(a.sequence, b.sequence);
      EXPECT_EQ(a.order, b.order);
      EXPECT_EQ(a.pitch_px, b.pitch_px);
      EXPECT_EQ(a.max_lines, b.max_lines);
    }
  }
  EXPECT_EQ(back.volume->center, rig.volume->center);
  EXPECT_EQ(back.volume->radius, rig.volume->radius);
  EXPECT_EQ(back.floor->point, rig.floor->point);
  EXPECT_EQ(back.floor->normal, rig.floor->normal);
}

TEST_F(RigFile, ColoursAreWrittenAsTheyWereStated) {
  Rig rig = example_rig();
  rig.projectors[0].patterns[0].colors = {PatternColor("blue"), PatternColor(Rgb{0, 1, 1})};
  write_rig(rig, folder_ / "rig.json");
  const nlohmann::json json = read_json(folder_ / "rig.json");
  EXPECT_EQ(json["projectors"][0]["pattern"]["colors"].dump(), "[\"blue\",[0.0,1.0,1.0]]");
  const Rig back = read_rig(folder_ / "rig.json");
  EXPECT_EQ(back.projectors[0].patterns[0].colors[1], PatternColor("cyan"));
  EXPECT_EQ(back.projectors[0].patterns[0].colors[1].text(), "cyan");
  EXPECT_EQ(back.projectors[1].patterns[1].colors[0].text(),
            "[0.90000000000000002, 0.33333333333333331, 0.050000000000000003]");
}

TEST_F(RigFile, FloorsAreChecked) {
  const auto floor_error = [&](const nlohmann::json& floor) {
    return error_after([&](auto& j) { j["floor"] = floor; });
  };
  EXPECT_EQ(floor_error({{"point", {0, 0, -100}}, {"normal", {0, 0, 2}}}), "accepted");
  EXPECT_EQ(read_rig(folder_ / "rig.json").floor->normal, Vec3(0, 0, 1));
  EXPECT_EQ(floor_error({{"point", {0, 0, -100}}, {"normal", {0, 0, 0}}}),
            "floor.normal = [0,0,0]: must be a direction, longer than 0");
  EXPECT_EQ(floor_error({{"point", {0, 0, -100}}}), "floor.normal: this key is missing");
  EXPECT_THAT(floor_error({{"point", {0, 0}}, {"normal", {0, 0, 1}}}), HasSubstr("floor.point"));
}

TEST_F(RigFile, ColourRegistrationComesBack) {
  const Rig rig = example_rig();
  write_rig(rig, folder_ / "rig.json");
  const Rig back = read_rig(folder_ / "rig.json");
  const auto expect_same = [](const ColorRegistration& a, const ColorRegistration& b) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(a.colors[k].shift_px, b.colors[k].shift_px);
      EXPECT_EQ(a.colors[k].scale, b.colors[k].scale);
    }
  };
  for (std::size_t i = 0; i < rig.cameras.size(); ++i)
    expect_same(rig.cameras[i].color_registration, back.cameras[i].color_registration);
  for (std::size_t i = 0; i < rig.projectors.size(); ++i)
    expect_same(rig.projectors[i].color_registration, back.projectors[i].color_registration);
}

TEST_F(RigFile, ColourRegistrationIsChecked) {
  const auto with = [&](const nlohmann::json& value) {
    return error_after(
        [&](nlohmann::json& rig) { rig["projectors"][0]["color_registration"] = value; });
  };
  EXPECT_EQ(with({{"red", {{"shift_px", {0.5, 0}}}}}), "accepted");
  EXPECT_THAT(with({{"cyan", {{"shift_px", {0.5, 0}}}}}),
              ::testing::HasSubstr("projectors[0].color_registration"));
  EXPECT_THAT(with({{"red", {{"shift_px", {0.5}}}}}), ::testing::HasSubstr("shift_px"));
  EXPECT_THAT(with({{"red", {{"scale", 1}}}}), ::testing::HasSubstr("shift_px"));
  EXPECT_THAT(with({{"red", {{"shift_px", {0, 0}}, {"scale", 0}}}}), ::testing::HasSubstr("scale"));
}

TEST(ColorRegistration, ThereAndBackIsTheSamePixel) {
  const Device device = example_rig().cameras[0];
  ColorRegistration registration;
  registration.colors[0] = {Vec2(0.4, -0.2), 1.001};
  const Vec2 pixel(17.5, 333);
  const Vec2 there = registration.of_color(0, device, pixel);
  EXPECT_GT((there - pixel).norm(), 0.1);
  EXPECT_LT((registration.from_color(0, device, there) - pixel).norm(), 1e-12);
  EXPECT_EQ(registration.of_color(1, device, pixel), pixel);
}

TEST_F(RigFile, OneColourNeedsNoCode) {
  EXPECT_EQ(error_after([](auto& json) {
              json["projectors"][0]["pattern"] = {{"orientation", "vertical"},
                                                  {"colors", {"white"}},
                                                  {"pitch_px", 10.5},
                                                  {"line_width_px", 3.25},
                                                  {"offset_px", 0.5}};
            }),
            "accepted");
  EXPECT_EQ(read_rig(folder_ / "rig.json").projectors[0].patterns[0].period(), 1);
}

TEST_F(RigFile, StructureErrorsNameTheField) {
  const auto at = [](nlohmann::json& json, const char* pointer) -> nlohmann::json& {
    return json[nlohmann::json::json_pointer(pointer)];
  };
  EXPECT_EQ(error_after([](auto& j) { j["extra"] = 1; }), "extra = 1: unknown key");
  EXPECT_EQ(error_after([](auto& j) { j.erase("unit"); }), "unit: this key is missing");
  EXPECT_THAT(error_after([](auto& j) { j["unit"] = "m"; }), HasSubstr("unit = \"m\": must be"));
  EXPECT_THAT(error_after([](auto& j) { j["format"] = "rig/2"; }), HasSubstr("format = \"rig/2\""));
  EXPECT_EQ(error_after([](auto& j) { j["cameras"][2].erase("K"); }),
            "cameras[2].K: this key is missing");
  EXPECT_EQ(error_after([](auto& j) { j["cameras"][2].erase("R"); }),
            "cameras[2].R: this key is missing");
  EXPECT_EQ(error_after([](auto& j) { j["projectors"][1].erase("t"); }),
            "projectors[1].t: this key is missing");
  EXPECT_EQ(error_after([](auto& j) { j["projectors"][1]["gamma"] = 1; }),
            "projectors[1].gamma = 1: unknown key");
  EXPECT_EQ(error_after([&](auto& j) { at(j, "/cameras/2/K/0/0") = "a"; }),
            "cameras[2].K[0][0] = \"a\": must be a number");
  EXPECT_EQ(error_after([&](auto& j) { at(j, "/cameras/2/K/0/0") = nullptr; }),
            "cameras[2].K[0][0] = null: must be a number");
  EXPECT_EQ(error_after([&](auto& j) { at(j, "/cameras/2/K/1/1") = -5; }),
            "cameras[2].K[1][1] = -5: must be > 0");
  EXPECT_EQ(error_after([&](auto& j) { at(j, "/cameras/2/K/2/0") = 0.5; }),
            "cameras[2].K[2][0] = 0.5: must be 0");
  EXPECT_THAT(error_after([&](auto& j) {
                at(j, "/cameras/0/distortion") = {0, 0};
              }),
              HasSubstr("cameras[0].distortion = [0,0]: must be a list of 5 or 8"));
  EXPECT_THAT(error_after([&](auto& j) { at(j, "/cameras/0/width") = 0; }),
              HasSubstr("cameras[0].width = 0: must be an integer"));
  EXPECT_THAT(error_after([&](auto& j) { at(j, "/cameras/0/width") = 12.5; }),
              HasSubstr("cameras[0].width = 12.5: must be an integer"));
  EXPECT_EQ(error_after([](auto& j) { j["cameras"][1]["name"] = "cam0"; }),
            "cameras[1].name = \"cam0\": names must differ from each other");
  EXPECT_THAT(error_after([](auto& j) { j["cameras"][1]["name"] = "../x"; }),
              HasSubstr("must be usable as a file name"));
  EXPECT_THAT(error_after([](auto& j) { j["cameras"] = nlohmann::json::array(); }),
              HasSubstr("cameras = []: must have 1 to 256 devices"));
  EXPECT_THAT(error_after([](auto& j) { j = nlohmann::json::array(); }), HasSubstr("object"));
}

TEST_F(RigFile, NonFiniteNumbersAreRejected) {
  for (const char* number : {"NaN", "Infinity", "1e999"}) {
    write_rig(example_rig(), folder_ / "rig.json");
    std::string text = read_file(folder_ / "rig.json");
    text.replace(text.find("2300.0"), 6, number);
    write_text(folder_ / "rig.json", text);
    EXPECT_THROW((void)read_rig(folder_ / "rig.json"), InputError) << number;
  }
}

TEST_F(RigFile, RotationsAreChecked) {
  EXPECT_THAT(error_after([](auto& j) {
                j["cameras"][1]["R"] = {{1, 0, 0}, {0, 1, 1e-3}, {0, 0, 1}};
              }),
              HasSubstr("cameras[1].R = [[1,0,0],[0,1,0.001],[0,0,1]]: must be a rotation"));
  EXPECT_THAT(error_after([](auto& j) {
                j["cameras"][1]["R"] = {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}};
              }),
              HasSubstr("is a reflection"));
  EXPECT_EQ(error_after([](auto& j) {
              j["cameras"][1]["R"] = {{1, 0, 0}, {0, 1, 5e-5}, {0, 0, 1}};
            }),
            "accepted");
}

TEST_F(RigFile, PatternsAreChecked) {
  const auto pattern_error = [&](const char* key, const nlohmann::json& value) {
    return error_after([&](auto& j) { j["projectors"][0]["pattern"][key] = value; });
  };
  EXPECT_EQ(pattern_error("pitch_px", 0), "projectors[0].pattern.pitch_px = 0: must be > 0");
  EXPECT_THAT(pattern_error("line_width_px", -1), HasSubstr("line_width_px = -1: must be > 0"));
  EXPECT_THAT(pattern_error("line_width_px", 13), HasSubstr("must be <= pitch_px"));
  EXPECT_THAT(pattern_error("offset_px", 1280), HasSubstr("offset_px = 1280: the first line"));
  EXPECT_THAT(pattern_error("colors", {"blue", "pink"}),
              HasSubstr("pattern.colors[1] = \"pink\": must be blue"));
  EXPECT_THAT(pattern_error("colors", {"blue", {0, 1.5, 0}}),
              HasSubstr("pattern.colors[1][1] = 1.5: must be in [0, 1]"));
  EXPECT_THAT(pattern_error("colors", {"blue", {0, 0, 0}}),
              HasSubstr("pattern.colors[1] = [0,0,0]: must not be all 0"));
  EXPECT_THAT(pattern_error("colors", {"blue", {1, 1}}),
              HasSubstr("pattern.colors[1] = [1,1]: must be a list of 3"));
  EXPECT_THAT(pattern_error("colors", {"blue", "cyan", "red"}),
              HasSubstr("pattern.alphabet = 2: must be the number of colors, 3"));
  EXPECT_THAT(pattern_error("sequence", {0, 1, 2}),
              HasSubstr("pattern.sequence[2] = 2: must be an integer from 0 to 1"));
  EXPECT_THAT(pattern_error("sequence", nlohmann::json::array()), HasSubstr("must have 1 to"));
  EXPECT_THAT(pattern_error("orientation", "diagonal"), HasSubstr("orientation = \"diagonal\""));
  EXPECT_THAT(pattern_error("order", 0), HasSubstr("order = 0: must be an integer from 1"));
  EXPECT_THAT(pattern_error("lines", 0), HasSubstr("lines = 0: must be an integer from 1"));
  EXPECT_EQ(pattern_error("colour", 1), "projectors[0].pattern.colour = 1: unknown key");
  EXPECT_THAT(error_after([](auto& j) { j["projectors"][1]["pattern"][0]["pitch_px"] = -2; }),
              HasSubstr("projectors[1].pattern[0].pitch_px = -2"));
  EXPECT_THAT(error_after([](auto& j) { j["projectors"][0]["pattern"].erase("order"); }),
              HasSubstr("pattern.order: this key is missing"));
  EXPECT_EQ(error_after([](auto& j) { j["projectors"][0].erase("pattern"); }), "accepted");
}

TEST_F(RigFile, OptionalCameraKeysAreChecked) {
  const auto camera_error = [&](const char* key, const nlohmann::json& value) {
    return error_after([&](auto& j) { j["cameras"][0][key] = value; });
  };
  EXPECT_THAT(camera_error("gamma", 0), HasSubstr("cameras[0].gamma = 0: must be > 0"));
  EXPECT_EQ(camera_error("mosaic", "BGGR"), "accepted");
  EXPECT_EQ(camera_error("mosaic", "RGBG"),
            "cameras[0].mosaic = \"RGBG\": must be RGGB, BGGR, GRBG or GBRG");
  EXPECT_EQ(camera_error("black_level", 1), "cameras[0].black_level = 1: must be in [0, 1)");
  EXPECT_EQ(camera_error("black_level", -0.1), "cameras[0].black_level = -0.1: must be in [0, 1)");
  EXPECT_THAT(camera_error("role", "x"), HasSubstr("cameras[0].role = \"x\""));
  EXPECT_THAT(camera_error("color_matrix", {{1, 0}, {0, 1}}), HasSubstr("must be a list of 3"));
  EXPECT_THAT(camera_error("color_matrix", {{1, 0, 0}, {0, 1, 0}, {1, 1, 0}}),
              HasSubstr("must be invertible"));
  EXPECT_THAT(camera_error("name", std::string(201, 'x')), HasSubstr("at most 200 bytes"));
  EXPECT_THAT(camera_error("color_matrix", {{"nobody", 1}}),
              HasSubstr("color_matrix.nobody = 1: there is no projector of this name"));
  EXPECT_THAT(error_after([](auto& j) { j["volume"]["radius"] = 0; }),
              HasSubstr("volume.radius = 0: must be > 0"));
}

TEST_F(RigFile, OutputsOfProjectorsAreChecked) {
  const auto output_error = [&](const nlohmann::json& value) {
    return error_after([&](auto& j) { j["projectors"][1]["output"] = value; });
  };
  EXPECT_EQ(output_error("DP-2"), "accepted");
  EXPECT_THAT(output_error(""), HasSubstr("projectors[1].output = \"\": must not be empty"));
  EXPECT_THAT(output_error(2), HasSubstr("projectors[1].output = 2"));
}

TEST_F(RigFile, DevicesMayLackTheirCalibration) {
  write_text(folder_ / "devices.json",
             R"({"format": "rig/1", "unit": "mm",
  "cameras": [{"name": "a", "width": 40, "height": 30},
              {"name": "b", "width": 40, "height": 30, "K": [[50, 0, 20], [0, 50, 15], [0, 0, 1]]}],
  "projectors": [{"name": "p", "width": 64, "height": 32}]})");
  const UncalibratedRig devices = read_devices(folder_ / "devices.json");
  ASSERT_EQ(devices.given.size(), 3U);
  EXPECT_FALSE(devices.given[0].K);
  EXPECT_TRUE(devices.given[1].K);
  EXPECT_FALSE(devices.given[1].distortion);
  EXPECT_FALSE(devices.given[2].pose);
  EXPECT_EQ(devices.rig.cameras[1].K(0, 0), 50);
  EXPECT_THROW((void)read_rig(folder_ / "devices.json"), InputError);
}

TEST_F(RigFile, AGivenFocalLengthInMillimetresIsRefused) {
  write_text(folder_ / "devices.json",
             R"({"format": "rig/1", "unit": "mm",
  "cameras": [{"name": "a", "width": 640, "height": 480, "K": [[8, 0, 320], [0, 8, 240], [0, 0, 1]]}],
  "projectors": [{"name": "p", "width": 64, "height": 32}]})");
  try {
    (void)read_devices(folder_ / "devices.json");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("cameras[0].K[0][0] = 8: must be in pixels"));
  }
}

TEST(WorkingVolume, IsWhereTheAxesMeet) {
  Rig rig = example_rig();
  const Sphere stated = working_volume(rig);
  EXPECT_EQ(stated.radius, 1.0 / 3);
  rig.volume.reset();
  for (Camera& camera : rig.cameras) camera.distortion = {};
  const Sphere derived = working_volume(rig);
  // All axes go through one point exactly.
  EXPECT_LT((derived.center - Vec3(10, 20, 30)).norm(), 1e-6);
  // Half the image height, 480 px at f = 2300, from about 1100 mm: 1100 sin(atan(480 / 2300)).
  EXPECT_NEAR(derived.radius, 225, 10);
}

TEST(WorkingVolume, IsInTheMiddleOfThePicturesOfShiftedLenses) {
  Rig rig = example_rig();
  rig.volume.reset();
  for (Camera& camera : rig.cameras) camera.distortion = {};
  const Sphere before = working_volume(rig);
  // The panel slides by 60 % of its height behind the lens, which turns back by as much.
  for (Projector& projector : rig.projectors) {
    const double shift = 0.6 * projector.height;
    const double angle = std::atan(shift / projector.K(1, 1));
    projector.K(1, 2) += shift;
    projector.device_from_world =
        RigidTransform{Eigen::AngleAxisd(angle, Vec3::UnitX()).toRotationMatrix(), Vec3::Zero()} *
        projector.device_from_world;
  }
  const Sphere shifted = working_volume(rig);
  EXPECT_LT((shifted.center - before.center).norm(), 0.05 * before.radius);
  EXPECT_NEAR(shifted.radius, before.radius, 0.1 * before.radius);
}

TEST(WorkingVolume, IsFiniteAndInFrontForParallelAxes) {
  Rig rig;
  rig.cameras.assign(2, ring_camera("a", 0, 0));
  rig.cameras[1].name = "b";
  rig.cameras[1].device_from_world.translation += Vec3(-100, 0, 0);
  const Sphere volume = working_volume(rig);
  EXPECT_GT((rig.cameras[0].device_from_world * volume.center).z(), 0);
  EXPECT_GT(volume.radius, 0);
  EXPECT_TRUE(volume.center.allFinite());
}

}  // namespace
}  // namespace pencilscan
