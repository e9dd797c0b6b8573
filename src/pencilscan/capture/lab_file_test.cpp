#include "pencilscan/capture/lab_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

class LabFile : public ::testing::Test {
 protected:
  std::string complaint(const nlohmann::ordered_json& json) {
    write_json(folder_.path() / "lab.json", json);
    try {
      (void)read_lab(folder_.path() / "lab.json");
      return "accepted";
    } catch (const InputError& error) {
      return std::string(error.what()).substr((folder_.path() / "lab.json").string().size() + 2);
    }
  }
  TemporaryFolder folder_{"lab_file"};
};

TEST_F(LabFile, ComesBackAsWritten) {
  Lab lab;
  lab.trigger = Trigger::kWire;
  lab.line = "Line2";
  lab.rate_hz = 12.5;
  lab.max_spread_ms = 1.5;
  lab.patience_s = 12;
  lab.cameras["cam0"] = {"aravis:Basler-1", {}, 33.25, 2, "BayerRG8"};
  lab.cameras["cam1"] = {"", {"gphoto2", "--filename", "{file}"}, {}, {}, {}};
  lab.outputs["proj0"] = "HDMI-1";
  lab.delay_ms["proj0"] = 48;
  write_lab(lab, folder_.path() / "lab.json");
  EXPECT_EQ(read_lab(folder_.path() / "lab.json"), lab);
}

TEST_F(LabFile, MistakesAreNamed) {
  const nlohmann::ordered_json good = {{"format", "lab/1"},
                                       {"cameras", {{"cam0", {{"device", "aravis:A"}}}}}};
  EXPECT_EQ(complaint(good), "accepted");
  auto bad = good;
  bad["format"] = "lab/2";
  EXPECT_THAT(complaint(bad), HasSubstr("format = \"lab/2\""));
  bad = good;
  bad["cameras"]["cam0"]["command"] = {"true"};
  EXPECT_THAT(complaint(bad), HasSubstr("either a \"device\" or a \"command\""));
  bad = good;
  bad["trigger"] = {{"kind", "magic"}};
  EXPECT_THAT(complaint(bad), HasSubstr("trigger.kind = \"magic\""));
  bad = good;
  bad["rate_hz"] = 0;
  EXPECT_THAT(complaint(bad), HasSubstr("rate_hz"));
  bad = good;
  bad["cameras"]["cam0"]["exposure_ms"] = 100000000.0;
  EXPECT_THAT(complaint(bad), HasSubstr("cameras.cam0.exposure_ms = 100000000.0: must be at most"));
  bad = good;
  bad["colour"] = 1;
  EXPECT_THAT(complaint(bad), HasSubstr("colour = 1: unknown key"));
}

TEST_F(LabFile, FoldersAreRelativeToIt) {
  write_text(folder_.path() / "lab.json",
             R"({"format": "lab/1", "cameras": {"cam0": {"device": "folder:shots"}}})");
  EXPECT_EQ(read_lab(folder_.path() / "lab.json").cameras["cam0"].device,
            "folder:" + (folder_.path() / "shots").string());
}

TEST_F(LabFile, FoldersAreWrittenRelativeToIt) {
  // As a command line names them, relative to where the program runs.
  const std::filesystem::path here = std::filesystem::relative(folder_.path());
  Lab lab;
  lab.cameras["cam0"].device = "folder:" + (here / "shots").string();
  lab.cameras["cam1"].device = "folder:/shots";
  write_lab(lab, here / "lab.json");
  const nlohmann::json written = read_json(here / "lab.json");
  EXPECT_EQ(written["cameras"]["cam0"]["device"], "folder:shots");
  EXPECT_EQ(written["cameras"]["cam1"]["device"], "folder:/shots");
  EXPECT_EQ(read_lab(here / "lab.json"), lab);
}

TEST(Lab, EveryCameraOfTheRigNeedsADevice) {
  Rig rig;
  rig.cameras.resize(1);
  rig.cameras[0].name = "cam0";
  EXPECT_THROW((void)open_lab_cameras({}, rig, "lab.json"), InputError);
  Lab lab;
  lab.cameras["cam0"].device = "ftp:x";
  EXPECT_THROW((void)open_lab_cameras(lab, rig, "lab.json"), InputError);
  lab.cameras["cam1"].device = "aravis:x";
  EXPECT_THROW((void)open_lab_cameras(lab, rig, "lab.json"), InputError);
}

TEST(Lab, WhatIsWrongWithADeviceIsSaidWhereItIsStated) {
  const TemporaryFolder folder("lab_devices");
  Rig rig;
  rig.cameras.resize(2);
  Lab lab;
  for (const char* name : {"cam0", "cam1"}) {
    rig.cameras[lab.cameras.size()].name = name;
    lab.cameras[name].device = "folder:" + folder.path().string();
  }
  const auto complaint = [&] {
    try {
      (void)open_lab_cameras(lab, rig, "lab.json");
      return std::string("accepted");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
  };
  lab.cameras["cam1"].device += "/.";
  EXPECT_THAT(complaint(), HasSubstr("lab.json: cameras.cam1.device = folder:"));
  EXPECT_THAT(complaint(), HasSubstr("is the device of cam0, too"));
  lab.cameras["cam1"].device = "folder:nosuch";
  EXPECT_THAT(complaint(),
              HasSubstr("lab.json: cameras.cam1.device = folder:nosuch: must be a folder"));
  lab.cameras["cam1"] = lab_camera_from_text("cam1=LAB1", "--camera").second;
  EXPECT_THAT(complaint(), HasSubstr("command line: --camera = cam1=LAB1: must begin with aravis"));
}

TEST(Lab, SpreadMayBeAQuarterOfTheExposure) {
  Lab lab;
  EXPECT_EQ(spread_limit_ms(lab), 0);
  lab.cameras["cam0"].exposure_ms = 32;
  EXPECT_EQ(spread_limit_ms(lab), 8);
  lab.max_spread_ms = 3;
  EXPECT_EQ(spread_limit_ms(lab), 3);
}

}  // namespace
}  // namespace pencilscan
