// What newcomers get wrong at the keyboard: each mistake ends in one line on stderr that names the
// wrong word and says what to do, with exit code 2, and nothing is written or replaced.

#include <vector>

#include "program.h"

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class Newcomer : public ProgramTest {
 protected:
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  }
  /// A tetrahedron inside of the ring's volume.
  void write_mesh() {
    write("mesh.obj",
          "v -60 -60 -50\nv 60 -60 -50\nv 0 70 -50\nv 0 0 80\n"
          "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  }
  /// A rig of two small cameras and projectors before that mesh, and what simulates it.
  std::string small_scene() {
    EXPECT_EQ(run("rig ring --out r.json --cameras 2 --projectors 2 --camera-width 64 "
                  "--camera-height 64 --camera-focal-px 115 --projector-width 64 "
                  "--projector-height 64")
                  .code,
              0);
    write_mesh();
    return "simulate --rig r.json --mesh mesh.obj --samples 1 ";
  }
  /// `arguments` refuse to replace `file`, leave it alone, and replace it with --overwrite.
  void expect_kept(const std::string& arguments, const std::string& file) {
    fs::create_directories((folder_ / file).parent_path());
    write(file, "mine");
    expect_bad(arguments, file + ": is there already: ");
    EXPECT_EQ(slurp(folder_ / file), "mine") << arguments;
    const Outcome replaced = run(arguments + " --overwrite");
    EXPECT_EQ(replaced.code, 0) << arguments << ": " << replaced.error;
    EXPECT_NE(slurp(folder_ / file), "mine") << arguments;
  }
};

TEST_F(Newcomer, IsToldTheWrongWordAndTheNearestRightOne) {
  expect_bad("recontruct --rig rig.json",
             "unknown command recontruct; did you mean reconstruct? (see pencilscan --help)");
  expect_bad("reconstruct --rigg rig.json --frames f --out o",
             "unknown option --rigg; did you mean --rig? (see pencilscan reconstruct --help)");
  expect_bad("rig rign --out rig.json",
             "unknown command rign; did you mean ring? (see pencilscan rig --help)");
  expect_bad("rig ring --out rig.json --camera 4",
             "unknown option --camera; did you mean --cameras? (see pencilscan rig ring --help)");
  expect_bad("ring --out rig.json", "unknown command ring; did you mean rig ring?");
  expect_bad("reconstruct --rig r --frames f --output o", "did you mean --out?");
  expect_bad("reconstruct --rig r --frames f --out o --method lineer",
             "--method = lineer: must be linear, multiview, joint or single-projector; did you "
             "mean linear? (see pencilscan reconstruct --help)");
  expect_bad("simulate --rig r --mesh m --out o --up w", "--up = w: must be x, y or z");
}

TEST_F(Newcomer, IsToldWhatIsMissingOrTooMuch) {
  expect_bad("rig ring", "--out is required (see pencilscan rig ring --help)");
  expect_bad("rig", "what is to be done? ring, check, import, export or picture");
  expect_bad("reconstruct --rig --frames f --out o",
             "--rig needs a value, not --frames (see pencilscan reconstruct --help)");
  expect_bad("rig check --rig", "--rig needs a value (see pencilscan rig check --help)");
  expect_bad("simulate --rig r --mesh m --out o --translate-mm 1 2",
             "--translate-mm needs 3 values");
  expect_bad("rig check --rig a --rig b", "--rig stands more than once");
  expect_bad("rig check --rig my rig.json", "unexpected word rig.json");
  expect_bad("--threads 2 rig check --rig rig.json",
             "unknown option --threads: options stand behind the command");
  expect_bad("dance", "unknown command dance: must be simulate, ");
}

TEST_F(Newcomer, IsToldWhichNumbersAreRight) {
  expect_bad("rig ring --out rig.json --cameras six",
             "--cameras = six: must be a whole number from 1 to 256");
  expect_bad("rig ring --out rig.json --pitch-px 1e9", "--pitch-px = 1e9: must be a number from 1");
  expect_bad("rig ring --out rig.json --seed -1", "--seed = -1: must be a whole number");
  expect_bad("capture --rate 0 --list", "--rate = 0: must be a number above 0");
}

TEST_F(Newcomer, OverwritesNothingUnasked) {
  ASSERT_EQ(run("rig ring --out r.json --cameras 2 --projectors 2").code, 0);
  expect_kept("rig ring --out rig.json", "rig.json");
  expect_kept("rig picture --rig r.json --out rig.png", "rig.png");
  expect_kept("rig export --rig r.json --opencv cv", "cv/proj1.yml");
  expect_kept("rig export --rig r.json --colmap model", "model/points3D.txt");
  expect_kept("rig import --colmap model --projector proj0 --projector proj1 --out imported.json",
              "imported.json");
  expect_kept("pattern --rig r.json --out p", "p/proj1.png");
  expect_kept("pattern --rig r.json --out g --gray-code", "g/proj1/007.png");
  write("calibration.json", "{\"format\": \"calibration/1\", \"verdict\": \"good\"}");
  expect_kept("report .", "./report.html");
  expect_kept("report . --out page.html", "page.html");
}

TEST_F(Newcomer, FiguresReplaceFiguresOnly) {
  ASSERT_EQ(run("rig ring --out rig.json --json figures.json").code, 0);
  const std::string rig = slurp(folder_ / "rig.json");
  EXPECT_EQ(run("rig check --rig rig.json --json figures.json").code, 0);
  EXPECT_THAT(slurp(folder_ / "figures.json"), HasSubstr("\"coverage\""));
  expect_bad("rig check --rig rig.json --json rig.json", "--json = rig.json: must be a new file");
  EXPECT_EQ(slurp(folder_ / "rig.json"), rig);
}

TEST_F(Newcomer, AFolderWithoutResultsHasNoReport) {
  fs::create_directories(folder_ / "empty" / "000000" / "pictures");
  expect_bad("report empty", "empty: there is nothing to report");
}

TEST_F(Newcomer, IsToldWhichPicturesAreThereAndWhichAreMissing) {
  ASSERT_EQ(run("rig ring --out r.json --cameras 1 --projectors 1 --camera-width 16 "
                "--camera-height 16 --projector-width 16 --projector-height 16 --offset-px 3")
                .code,
            0);
  ASSERT_EQ(run("pattern --rig r.json --out shown --gray-code").code, 0);
  const fs::path pictures = folder_ / "captures" / "proj0" / "cam0";
  fs::create_directories(pictures.parent_path());
  fs::rename(folder_ / "shown" / "proj0", pictures);
  const std::string scan = "scan --captures captures --rig r.json --out surface --overwrite";
  fs::rename(pictures / "005.png", folder_ / "kept.png");
  expect_bad(scan,
             "= 5: must be 18 (or 10 without inverses) for a panel of 16 x 16 px; 005.png is");
  fs::rename(folder_ / "kept.png", pictures / "005.PNG");
  EXPECT_THAT(run(scan).error, Not(HasSubstr("missing")));  // whatever else is wrong with them
  fs::copy_file(pictures / "004.png", pictures / "004.bmp");
  expect_bad(scan, "004 = 004.bmp and 004.png: must be one file");
  fs::remove(pictures / "004.bmp");
  fs::rename(pictures / "000.png", pictures / "IMG_000.png");
  expect_bad(scan, "000.png is missing, it holds 001.png, ");
  fs::rename(folder_ / "captures" / "proj0", folder_ / "captures" / "Projector1");
  expect_bad(scan, "Projector1: folder = Projector1: must be the name of a projector (proj0)");
}

TEST_F(Newcomer, IsToldHowPicturesOfFramesAreNamed) {
  ASSERT_EQ(run("rig ring --out r.json --cameras 2 --projectors 2").code, 0);
  const std::string reconstruct = "reconstruct --rig r.json --frames frames --out result";
  const fs::path frame = folder_ / "frames" / "000000";
  fs::create_directories(folder_ / "frames");
  write("frames/shot.png", "");
  expect_bad(reconstruct, "must hold at least one frame folder such as 000000; it holds shot.png");
  fs::create_directories(frame);
  write("frames/000000/Camera_0.png", "");
  expect_bad(reconstruct, "named like it, as cam0.png; it holds Camera_0.png");
  write("frames/000000/cam0.png", "");
  write("frames/000000/Cam1.png", "");
  expect_bad(reconstruct, "cam1 = Cam1.png: must be named like the camera, cam1.png");
  write("frames/000000/cam0.jpg", "");
  expect_bad(reconstruct, "frames/000000: cam0 = cam0.jpg and cam0.png: must be one file");
}

TEST_F(Newcomer, IsToldOfObjectsInAnotherUnit) {
  ASSERT_EQ(run("rig ring --out r.json --cameras 1 --projectors 1 --camera-width 64 "
                "--camera-height 64 --camera-focal-px 115")
                .code,
            0);
  write("metres.obj",
        "v -0.06 -0.06 -0.05\nv 0.06 -0.06 -0.05\nv 0 0.07 -0.05\nv 0 0 0.08\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  const std::string simulate = "simulate --rig r.json --mesh metres.obj --samples 1";
  EXPECT_THAT(run(simulate + " --out small").error,
              HasSubstr("probably in metres instead of millimetres. --scale 1000 makes it right"));
  const Outcome scaled = run(simulate + " --scale 1000 --out right");
  EXPECT_EQ(scaled.code, 0);
  EXPECT_THAT(scaled.error, Not(HasSubstr("warning")));
  const Outcome fitted = run(simulate + " --fit --up y --texture stripes --out fitted");
  EXPECT_EQ(fitted.code, 0) << fitted.error;
  EXPECT_THAT(fitted.error, Not(HasSubstr("warning")));
}

TEST_F(Newcomer, MayBringLightOfAnotherRenderer) {
  const std::string simulate = small_scene();
  ASSERT_EQ(run(simulate + "--bits 16 --out own").code, 0);
  // Light without a sensor is the picture; the same sensor makes the same of the same light.
  const Outcome through = run(simulate + "--light own/frames --bits 16 --out through");
  ASSERT_EQ(through.code, 0) << through.error;
  for (const char* camera : {"frames/000000/cam0.png", "frames/000000/cam1.png"}) {
    EXPECT_EQ(slurp(folder_ / "through" / camera), slurp(folder_ / "own" / camera));
  }
  expect_bad(simulate + "--light own/frames --frame-count 2 --out o", "own/frames/000001/cam0.png");
  expect_bad(simulate + "--light own/frames --motion-mm-s 1 0 0 --out o", "--motion-mm-s");
  write("own/frames/000000/cam0.png", slurp(folder_ / "own/truth/mesh.ply"));
  const Outcome broken = run(simulate + "--light own/frames --out o");
  EXPECT_EQ(broken.code, 2);
  EXPECT_THAT(broken.error, HasSubstr("own/frames/000000/cam0.png: must be a PNG"));
}

TEST_F(Newcomer, WritesScenesForOtherRenderers) {
  const std::string simulate = small_scene();
  ASSERT_EQ(run(simulate + "--export-blender --frame-count 2 --out made").code, 0);
  for (const char* file : {"render.py", "scene.json", "film/proj0.png", "film/proj1.png",
                           "objects/000000.ply", "objects/000001.ply"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "made/blender" / file)) << file;
  }
  expect_bad(simulate + "--export-blender --texture stripes --out o", "--texture");
}

TEST_F(Newcomer, IsToldThatTheMemoryDoesNotSuffice) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer itself takes more memory than the limit of this test";
#endif
  ASSERT_EQ(run("rig ring --out r.json --cameras 1 --projectors 1 --projector-width 65500 "
                "--projector-height 65500")
                .code,
            0);
  const Outcome outcome = run("pattern --rig r.json --out p", "ulimit -v 8000000 &&");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.error,
            "pencilscan: there is not enough memory for images or results of this size\n");
  EXPECT_FALSE(fs::exists(folder_ / "p" / "proj0.png"));
}

TEST_F(Newcomer, WhoInterruptsIsToldHowFarItWas) {
  write_mesh();
  ASSERT_EQ(run("rig ring --out rig.json").code, 0);
  // Of 256 rays a pixel, no machine is done with six images in this time.
  const Outcome outcome =
      run("simulate --rig rig.json --mesh mesh.obj --out scene --samples 16 "
          "--threads 1",
          "timeout -s INT 6");
  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.error, HasSubstr("rendering frames: image 0 of 6, 0 %\n"));
  EXPECT_THAT(outcome.error, HasSubstr("pencilscan: interrupted at rendering frames: image "));
  EXPECT_THAT(outcome.error, ::testing::EndsWith("nothing of the scene is kept, start again\n"));
  // Nothing that is in the way of the same command.
  EXPECT_TRUE(fs::is_empty(folder_ / "scene") || fs::exists(folder_ / "scene" / ".making"));
  EXPECT_FALSE(fs::exists(folder_ / "scene" / "rig.json"));
}

}  // namespace
