// Bad input through the built program: exit code 2, one line on stderr that names file, field,
// value and rule, and no output touched. The exit codes of success and of a full disk stand beside
// it.

#include "program.h"

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class Program : public ProgramTest {
 protected:
  /// The default ring with the first `from` replaced by `to`, as rig.json.
  void make_rig(const std::string& from = "", const std::string& to = "") {
    static std::string good;
    if (good.empty()) {
      ASSERT_EQ(run("rig ring --out good.json").code, 0);
      good = slurp(folder_ / "good.json");
      fs::remove(folder_ / "good.json");
    }
    std::string text = good;
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    std::ofstream(folder_ / "rig.json") << text;
  }

  /// The same complaint from every command that needs the rig and nothing else.
  void expect_bad_rig(const std::string& from, const std::string& to, const std::string& part) {
    make_rig(from, to);
    for (const char* arguments : {"pattern --rig rig.json --out out", "rig check --rig rig.json"}) {
      expect_bad(arguments, "rig.json: " + part);
    }
  }
};

TEST_F(Program, RingPatternAndCheckWorkTogether) {
  make_rig();
  EXPECT_EQ(run("pattern --rig rig.json --out out --json figures.json").code, 0);
  for (int i = 0; i < 6; ++i) {
    EXPECT_TRUE(fs::exists(folder_ / ("out/proj" + std::to_string(i) + ".png")));
  }
  EXPECT_THAT(slurp(folder_ / "figures.json"), HasSubstr("\"lines\""));
  EXPECT_EQ(run("rig check --rig rig.json --json check.json").code, 0);
  EXPECT_THAT(slurp(folder_ / "check.json"), HasSubstr("\"warnings\": []"));
}

TEST_F(Program, HelpAndVersionSucceed) {
  for (const char* arguments :
       {"--help", "--version", "pattern --help", "rig ring --help", "rig check --help"}) {
    EXPECT_EQ(run(arguments).code, 0) << arguments;
  }
}

TEST_F(Program, CommandLineErrorsAreBadInput) {
  expect_bad("", "a command is missing: simulate, ");
  expect_bad("dance", "unknown command dance");
  expect_bad("pattern --out out", "--rig");
  expect_bad("pattern --rig rig.json --out out --colour red", "--colour");
  expect_bad("rig ring --out rig.json --cameras 0",
             "--cameras = 0: must be a whole number from 1 to 256");
  expect_bad("rig ring --out rig.json --pitch-px nan", "--pitch-px");
  expect_bad("rig ring --out rig.json --threads -1", "--threads");
  expect_bad("rig ring --out rig.json --line-width-px 13", "--line-width-px = 13.0: must be");
  expect_bad("rig ring --out rig.json --distance-mm 100", "--distance-mm = 100.0: must be");
}

TEST_F(Program, ArtefactsThatAreNoneAreBadInput) {
  expect_bad("artefact sphere none.ply", "none.ply: no such file or folder");
  expect_bad("artefact ballbar a.ply", "--diameter");
  std::ofstream(folder_ / "a.ply") << "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                                      "property float y\nproperty float z\nend_header\nnan 0 0\n";
  expect_bad("artefact plate a.ply", "must hold points with finite positions");
  expect_bad("artefact plate . ", "must be a PLY file, or hold points.ply");
}

TEST_F(Program, AnEmptyWordIsNoFolder) {
  expect_bad("rig ring --out ''", "--out needs a value, and the word behind it is empty");
  expect_bad("rig ring --out=", "--out= needs a value behind the =");
  expect_bad("rig ''", "word 2 is empty");
}

TEST_F(Program, FiguresDoNotTakeThePlaceOfTheOutput) {
  const Outcome outcome = run("rig ring --out rig.json --json ./rig.json");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.error, HasSubstr("must be a file of its own, and --out names it"));
  EXPECT_FALSE(fs::exists(folder_ / "rig.json"));
}

TEST_F(Program, MissingOrBrokenRigFilesAreBadInput) {
  expect_bad("pattern --rig none.json --out out", "none.json: the file does not exist");
  expect_bad("rig check --rig .", "must be a file");
  std::ofstream(folder_ / "rig.json") << "{\"format\": ";
  expect_bad("rig check --rig rig.json", "rig.json: must be JSON");
}

TEST_F(Program, WhatCannotBeReachedIsNotCalledAbsent) {
  fs::create_symlink("loop", folder_ / "loop");
  expect_bad("pattern --rig loop --out out",
             "loop: cannot be opened: Too many levels of symbolic links");
  make_rig();
  fs::create_directories(folder_ / "frames" / "000000");
  fs::create_symlink("cam0.png", folder_ / "frames" / "000000" / "cam0.png");
  expect_bad("reconstruct --rig rig.json --frames frames --out out",
             "cam0.png: cannot be opened: Too many levels of symbolic links");
}

TEST_F(Program, AFrameFolderIsNamedInUtf8) {
  make_rig();
  fs::create_directories(folder_ / "frames" / "f\xfcr");
  std::ofstream(folder_ / "frames" / "f\xfcr" / "cam0.png") << "";
  expect_bad("reconstruct --rig rig.json --frames frames --out out", "must have a name in UTF-8");
}

TEST_F(Program, RigRulesNameFieldAndValue) {
  expect_bad_rig("\"unit\": \"mm\"", "\"unit\": \"mm\", \"units\": 1", "units = 1: unknown key");
  expect_bad_rig("\"unit\": \"mm\",", "", "unit: this key is missing");
  expect_bad_rig("2300.0", "NaN", "must be JSON (which has no NaN or Infinity)");
  expect_bad_rig("2300.0", "1e999", "K: must be finite");
  expect_bad_rig("2300.0", "-1", "cameras[0].K[0][0] = -1: must be > 0");
  expect_bad_rig("\"R\": [[", "\"R\": [[7, 0, 0], [", "cameras[0].R");
  expect_bad_rig("\"cam1\"", "\"cam0\"", "cameras[1].name = \"cam0\": names must differ");
  expect_bad_rig("\"pitch_px\": 12.0", "\"pitch_px\": 0",
                 "projectors[0].pattern.pitch_px = 0: must be > 0");
  expect_bad_rig("\"blue\"", "\"navy\"",
                 "projectors[0].pattern.colors[0] = \"navy\": must be blue");
}

TEST_F(Program, ARotationThatIsNoneIsBadInput) {
  make_rig();
  std::string text = slurp(folder_ / "rig.json");
  const auto begin = text.find("\"R\": ") + 5;
  const auto end = text.find("]]", begin) + 2;
  text.replace(begin, end - begin, "[[1,0,0],[0,1,0],[0,0,2]]");
  std::ofstream(folder_ / "rig.json") << text;
  expect_bad("rig check --rig rig.json",
             "rig.json: cameras[0].R = [[1,0,0],[0,1,0],[0,0,2]]: must be a rotation");
}

TEST_F(Program, AProjectorWithoutPatternShowsNothing) {
  make_rig();
  std::string text = slurp(folder_ / "rig.json");
  const auto begin = text.find(",\n   \"pattern\"");
  ASSERT_NE(begin, std::string::npos);
  text.erase(begin, text.find('}', begin) + 1 - begin);
  std::ofstream(folder_ / "rig.json") << text;
  expect_bad("pattern --rig rig.json --out out", "rig.json: projectors[0].pattern: this key");
  // What a calibration of devices without patterns gives.
  fs::create_directories(folder_ / "frames" / "000000");
  std::ofstream(folder_ / "frames" / "000000" / "cam0.png") << "";
  for (const char* command : {"reconstruct --rig rig.json --frames frames --out out",
                              "sequence submit --local 1 --rig rig.json --frames frames --out out",
                              "rig check --rig rig.json --frames frames"})
    expect_bad(command,
               "rig.json: projectors[0].pattern: this key is missing: there is nothing to "
               "see of this projector");
}

TEST_F(Program, AFullDiskIsAFailedStageAndLeavesNothing) {
  make_rig();
  const std::size_t before = file_count();
  // Patterns compress well: one block of 512 bytes is too little for any of them.
  const Outcome outcome = run("pattern --rig rig.json --out .", "ulimit -f 1 &&");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.error, HasSubstr("cannot be written"));
  EXPECT_EQ(file_count(), before);
}

}  // namespace
