// What newcomers get wrong at the keyboard: each mistake ends in one line on stderr that names the
// wrong word and says what to do, with exit code 2, and nothing is written or replaced.

#include <cmath>
#include <vector>

#include "program.h"

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class Newcomer : public ProgramTest {
 protected:
  void write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  /// A tetrahedron inside of the ring's volume.
  void write_mesh() {
    write("mesh.obj",
          "v -60 -60 -50\nv 60 -60 -50\nv 0 70 -50\nv 0 0 80\n"
          "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  }
  /// Points of a plate of 160 x 120 mm as PLY.
  static std::string plate() {
    std::string points =
        "ply\nformat ascii 1.0\nelement vertex 4941\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n";
    for (int x = 0; x <= 80; ++x)
      for (int y = 0; y <= 60; ++y)
        points += std::to_string(2 * x) + " " + std::to_string(2 * y) + " 0." +
                  std::to_string((7 * x + 5 * y) % 10) + "\n";
    return points;
  }
  /// The same of a ball.
  static std::string ball_of_80_mm() {
    std::string points =
        "ply\nformat ascii 1.0\nelement vertex 1000\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n";
    for (int i = 0; i < 1000; ++i) {
      const double z = (i + 0.5) / 500 - 1;
      const double across = std::sqrt(1 - z * z);
      points += std::to_string(40 * across * std::cos(2.4 * i)) + " " +
                std::to_string(40 * across * std::sin(2.4 * i)) + " " + std::to_string(40 * z) +
                "\n";
    }
    return points;
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
  /// A rig of three small cameras and projectors, and its Gray-code captures of that mesh.
  void write_captures() {
    write_mesh();
    EXPECT_EQ(run("rig ring --out r.json --cameras 3 --projectors 3 --camera-width 160 "
                  "--camera-height 120 --camera-focal-px 287 --projector-width 256 "
                  "--projector-height 192 --projector-focal-px 460 --pitch-px 16")
                  .code,
              0);
    EXPECT_EQ(run("simulate --rig r.json --mesh mesh.obj --samples 1 --gray-code --out cap").code,
              0);
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
  expect_bad("simulate --rig r --mesh m --out o --frame-count 2 --translate-mm 1 2",
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
  expect_bad("reconstruct --rig r --frames f --out o --join-pixels 1.5",
             "--join-pixels = 1.5: must be a whole number from 1 to 16");
}

TEST_F(Newcomer, IsToldWhichOptionsWouldHaveNoEffect) {
  const std::string simulate = "simulate --rig r --mesh m --out o ";
  const std::string reconstruct = "reconstruct --rig r --frames f --out o ";
  const std::string submit = "sequence submit --local 1 --rig r --frames f --out o ";
  const std::pair<std::string, const char*> mistakes[] = {
      {"pattern --rig r --out o --solids",
       "--solids requires --gray-code (see pencilscan pattern --help)"},
      {"pattern --rig r --out o --no-inverses", "--no-inverses requires --gray-code"},
      {"capture --rig r --out o --solids", "--solids requires --gray-code"},
      {"capture --rig r --out o --gray-code --seconds 3",
       "--seconds and --gray-code do not go together (see pencilscan capture --help)"},
      {"capture --rig r --test l.json --frames 2", "--frames and --test do not go together"},
      {"capture --rig r --list", "--rig and --list do not go together"},
      {"show --seconds 1 --list", "--seconds and --list do not go together"},
      {"show --rig r --assign n.json --what lines", "--assign needs --what identify"},
      {"show --rig r --assign n.json --projector proj0", "--projector and --assign do not go"},
      {simulate + "--color-captures", "--color-captures requires --gray-code"},
      {simulate + "--jpeg 90 --bits 16", "--jpeg needs --bits 8"},
      {simulate + "--light l --albedo 0.3", "--albedo does not go with --light: light is as it"},
      {"rig check --rig r --put-back n.json", "--put-back requires --frames"},
      {"rig check --rig r --frame-count 4", "--frame-count requires --frames"},
      {"lab --out o --rig r --lab l --noise high", "--noise requires --virtual"},
      {"lab --out o --virtual --lab l", "--lab and --virtual do not go together"},
      {"lab --out o --virtual --port 8000", "--port needs --page where --virtual is"},
      {"lab --out o --virtual --page --poses 3", "--page and --poses do not go together"},
      {reconstruct + "--no-mesh --mesh-formats obj", "--no-mesh and --mesh-formats do not go"},
      {reconstruct + "--no-mesh --depth-maps", "--no-mesh and --depth-maps do not go together"},
      {reconstruct + "--no-depth --depth-maps", "--no-depth and --depth-maps do not go together"},
      {reconstruct + "--method linear --depth-maps", "--depth-maps needs --method joint"},
      {submit + "--no-mesh --mesh-formats obj", "--no-mesh and --mesh-formats do not go together"},
      {submit + "--depth-maps --method multiview", "--depth-maps needs --method joint"}};
  for (const auto& [arguments, complaint] : mistakes) expect_bad(arguments, complaint);
  // What asks for no output is told, and what is wrong beside it stays the error.
  const std::pair<std::string, const char*> told[] = {
      {simulate + "--fit --scale 2", "--scale has no effect here: it does not change what --fit"},
      {simulate + "--rotate-deg 5", "--rotate-deg has no effect here: it needs --frame-count 2"},
      {simulate + "--translate-mm 1 0 0", "--translate-mm has no effect"},
      {simulate + "--exposure-ms 5", "it needs --motion-mm-s or --spin-deg-s"},
      {simulate + "--contrast 0.3", "--contrast has no effect here: it needs --texture checker"},
      {simulate + "--texture none --texture-mm 3", "--texture-mm has no effect"},
      {simulate + "--roughness 0.1", "--roughness has no effect here: it needs --specular above 0"},
      {reconstruct + "--multiview-cost published", "it needs --method multiview"},
      {"sequence export --result r --zarr z --frames-per-second 5", "it needs --usd"},
      {"artefact plate p.ply --length 300", "--length has no effect here: it needs --width"},
      {"artefact plate p.ply --width 300", "--width has no effect here: it needs --length"},
      {submit + "--limit 3", "--limit has no effect here: it needs --slurm"},
      {"scan --captures c --rig r --out o --no-mesh --cell-mm 2", "it changes the mesh alone"},
      {"artefact plate p.ply --overwrite", "--overwrite has no effect here: it needs --report"},
      {"artefact plate p.ply --surface mesh", "--surface has no effect here: it needs a result"},
      {"capture --rig r --lab l --out o --overwrite", "it needs --test"},
      {"rig check --rig r --overwrite", "it needs --put-back"},
      {"rig ring --out none/r.json --lines vertical --horizontal-elevation-deg 30 --pitch-px 3",
       "it needs a projector of horizontal lines"}};
  for (const auto& [arguments, warning] : told) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.error, ::testing::StartsWith("pencilscan: warning: ")) << arguments;
    EXPECT_THAT(outcome.error, HasSubstr(warning)) << arguments;
    EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 2) << outcome.error;
  }
}

TEST_F(Newcomer, IsToldWhichValuesAreOfNoDevice) {
  const std::string ring = "rig ring --overwrite --out ring.json --projectors 2 ";
  EXPECT_EQ(run(ring).error, "");
  EXPECT_EQ(run(ring + "--colors red,blue --colors green,cyan").error, "");
  EXPECT_THAT(run(ring + "--colors red,blue --colors green,cyan --colors red,white").error,
              HasSubstr("--colors: 3 values for 2 projectors"));
  EXPECT_THAT(run(ring + "--roll-deg 1 --roll-deg 2 --roll-deg 3").error, HasSubstr("--roll-deg"));
  write("d.json", R"({"format": "rig/1", "unit": "mm",)"
                  R"( "cameras": [{"name": "cam0", "width": 64, "height": 48}],)"
                  R"( "projectors": [{"name": "proj0", "width": 64, "height": 48}]})");
  const std::string calibrate = "calibrate --captures none --devices d.json --out c/rig.json ";
  EXPECT_THAT(run(calibrate).error, Not(HasSubstr("no effect")));
  EXPECT_THAT(run(calibrate + "--focal-tolerance 1").error, HasSubstr("no device has a K"));
}

TEST_F(Newcomer, IsToldThatAMosaicOfTheRigStandsAboveThatOfTheSimulator) {
  const std::string simulate = small_scene();
  EXPECT_THAT(run(simulate + "--interpolated RGGB --out a").error, Not(HasSubstr("no effect")));
  std::string rig = slurp(folder_ / "r.json");
  for (auto at = rig.find("\"width\": 64"); at < rig.find("\"projectors\"");
       at = rig.find("\"width\": 64", at + 40))
    rig.insert(at, "\"mosaic\": \"RGGB\", ");
  write("r.json", rig);
  const Outcome outcome = run(simulate + "--interpolated RGGB --out b");
  EXPECT_EQ(outcome.code, 0) << outcome.error;
  EXPECT_THAT(outcome.error, HasSubstr("--interpolated has no effect here: it needs a camera"));
}

TEST_F(Newcomer, MayGiveOptionsInAnyOrder) {
  // The method stands behind what needs it; "f" is then what is wrong.
  ASSERT_EQ(run("rig ring --out r.json").code, 0);
  expect_bad(
      "reconstruct --multiview-cost published --rig r.json --frames f --out o "
      "--method multiview",
      "f: must be a folder that holds frame folders");
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

TEST_F(Newcomer, ReplacesNoCaptureByAScene) {
  const std::string simulate = small_scene() + "--out mine --overwrite";
  fs::create_directories(folder_ / "mine/frames/000099");
  write("mine/frames/000099/cam0.png", "taken");
  fs::copy_file(folder_ / "r.json", folder_ / "mine/rig.json");
  expect_bad(simulate, "must hold an earlier scene (rig.json and truth/) to be replaced");
  EXPECT_EQ(slurp(folder_ / "mine/frames/000099/cam0.png"), "taken");
  fs::remove_all(folder_ / "mine");
  EXPECT_EQ(run(simulate).code, 0);
  write("mine/frames/old", "of the scene before");
  EXPECT_EQ(run(simulate).code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "mine/frames/old"));
}

TEST_F(Newcomer, ReplacesNoReportOfAnotherRig) {
  write("calibration.json", R"({"rig": "other.json"})");
  expect_bad("calibrate --captures c --devices d.json --out rig.json",
             "must be in another folder: calibration.json is not of this rig");
  write("calibration.json", R"({"rig": "rig.json"})");
  expect_bad("calibrate --captures c --devices d.json --out rig.json", "d.json: ");
  fs::remove(folder_ / "calibration.json");
  write("calibration.html", "my notes");
  expect_bad("calibrate --captures c --devices d.json --out rig.json",
             "calibration.html is not of this rig");
}

TEST_F(Newcomer, AReportNamesTheRigThatItIsOf) {
  write_captures();
  write("rig.json", "mine");
  // Too few correspondences for a rig.
  const std::string calibrate =
      "calibrate --captures cap/captures --devices r.json --known-distance cam0 cam1 850 ";
  EXPECT_EQ(run(calibrate + "--out rig.json --overwrite").code, 1);
  EXPECT_EQ(slurp(folder_ / "rig.json"), "mine");
  EXPECT_THAT(slurp(folder_ / "calibration.json"), HasSubstr("\"verdict\": \"unusable\""));
  EXPECT_THAT(slurp(folder_ / "calibration.json"), Not(HasSubstr("rig.json")));
  // The next attempt replaces it, whatever its rig is called.
  EXPECT_EQ(run(calibrate + "--out other.json").code, 1);
}

TEST_F(Newcomer, FiguresReplaceFiguresOnly) {
  ASSERT_EQ(run("rig ring --out rig.json --json figures.json").code, 0);
  const std::string rig = slurp(folder_ / "rig.json");
  EXPECT_EQ(run("rig check --rig rig.json --json figures.json").code, 0);
  EXPECT_THAT(slurp(folder_ / "figures.json"), HasSubstr("\"coverage\""));
  expect_bad("rig check --rig rig.json --json rig.json", "--json = rig.json: must be a new file");
  EXPECT_EQ(slurp(folder_ / "rig.json"), rig);
  // Files of results that say no format, and those of others.
  for (const std::string text : {R"({"cameras": [], "points": 3})", R"({"mine": 1})", "[1]"}) {
    write("report.json", text);
    expect_bad("rig check --rig rig.json --json report.json", "figures of an earlier run");
    EXPECT_EQ(slurp(folder_ / "report.json"), text);
  }
  write("empty.json", "");
  EXPECT_EQ(run("rig check --rig rig.json --json empty.json").code, 0);
  EXPECT_THAT(slurp(folder_ / "empty.json"), HasSubstr("\"figures/1\""));
}

TEST_F(Newcomer, AScanLeavesNoMeshOfAnEarlierOne) {
  write_captures();
  const std::string scan = "scan --captures cap/captures --rig r.json --out surface ";
  ASSERT_EQ(run(scan).code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "surface/mesh.ply"));
  expect_bad(scan + "--no-mesh", "is there already: ");
  ASSERT_EQ(run(scan + "--no-mesh --overwrite").code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "surface/points.ply"));
  EXPECT_FALSE(fs::exists(folder_ / "surface/mesh.ply"));
  ASSERT_EQ(run(scan + "--overwrite").code, 0);
  const Outcome few = run(scan + "--step 8 --overwrite");
  EXPECT_EQ(few.code, 1);
  EXPECT_THAT(few.error, HasSubstr("too few for a mesh; surface/points.ply has them"));
  EXPECT_FALSE(fs::exists(folder_ / "surface/mesh.ply"));
  fs::remove(folder_ / "surface/points.ply");
  write("surface/mesh.ply", "mine");
  expect_bad(scan + "--no-mesh", "surface/mesh.ply: is there already: ");
}

TEST_F(Newcomer, AFolderWithoutResultsHasNoReport) {
  fs::create_directories(folder_ / "empty" / "000000" / "pictures");
  expect_bad("report empty", "empty: there is nothing to report");
  const Outcome view = run("view empty", "timeout 20");
  EXPECT_EQ(view.code, 2);
  EXPECT_THAT(view.error, ::testing::StartsWith("pencilscan: empty: there is nothing to view: "));
}

TEST_F(Newcomer, ExportsTheTwoDevicesOfAPair) {
  ASSERT_EQ(run("rig ring --out r.json").code, 0);
  const std::string pair = "rig export --rig r.json --opencv cv --stereo ";
  expect_bad(pair + "cam0 cam0", "--stereo = cam0 cam0: must be two different devices");
  EXPECT_THAT(run(pair + "cam0 proj0").output, HasSubstr("devices  2\n"));
  EXPECT_TRUE(fs::exists(folder_ / "cv" / "cam0-proj0.yml"));
}

TEST_F(Newcomer, CountsAPoseOnce) {
  ASSERT_EQ(run("rig ring --out r.json").code, 0);
  fs::create_directories(folder_ / "pose1");
  fs::create_directory_symlink("pose1", folder_ / "pose2");
  for (const char* again : {"pose1", "./pose1/", "pose2"})
    expect_bad(
        std::string("calibrate --devices r.json --out rig.json --captures pose1 --captures ") +
            again,
        std::string(again) + ": must be another folder than pose1");
}

TEST_F(Newcomer, IsToldThatAFolderCameraTakesNewPicturesOnly) {
  static_cast<void>(small_scene());
  fs::create_directories(folder_ / "more");
  write("shots/cam0.png", "");
  const Outcome outcome =
      run("capture --rig r.json --camera cam0=folder:shots --camera cam1=folder:more --seconds 1 "
          "--out frames");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.error,
              HasSubstr("not a single frame came; cam0 is a folder: a picture counts "
                        "that appears there after the start"));
}

TEST_F(Newcomer, MayUpdateTheLabFileThatIsTested) {
  static_cast<void>(small_scene());
  fs::create_directories(folder_ / "shots");
  fs::create_directories(folder_ / "more");
  const std::string lab = R"({"format": "lab/1", "cameras": {"cam0": {"device": "folder:shots"},)"
                          R"( "cam1": {"device": "folder:more"}}})";
  write("lab.json", lab);
  write("other.json", lab);
  const std::string test = "capture --rig r.json --lab lab.json --test ";
  expect_bad(test + "other.json", "--test = other.json: is there already");
  // It goes on to the projectors, of which there are none here, or none with an output.
  const Outcome outcome = run(test + "./lab.json");
  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.error, Not(HasSubstr("is there already")));
  EXPECT_EQ(slurp(folder_ / "lab.json"), lab);
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
  EXPECT_THAT(
      run(simulate + " --scale 10 --out wrong").error,
      HasSubstr("mm large with --scale 10 and the rig's volume 340 mm: the mesh is probably "
                "in metres instead of millimetres. --scale 1000 makes it right"));
  const Outcome scaled = run(simulate + " --scale 1000 --out right");
  EXPECT_EQ(scaled.code, 0);
  EXPECT_THAT(scaled.error, Not(HasSubstr("warning")));
  const Outcome fitted = run(simulate + " --fit --up y --texture stripes --out fitted");
  EXPECT_EQ(fitted.code, 0) << fitted.error;
  EXPECT_THAT(fitted.error, Not(HasSubstr("warning")));
}

TEST_F(Newcomer, IsToldOfArtefactsOfAnotherSize) {
  write("plate.ply", plate());
  const std::string measure = "artefact plate plate.ply --thickness 10 ";
  const Outcome right = run(measure + "--length 160 --width 120 --border 5");
  EXPECT_EQ(right.code, 0) << right.error;
  EXPECT_EQ(right.error, "");
  expect_bad(measure + "--length 16 --width 12",
             "plate.ply: --length x --width = 16 x 12: must be the sides of the plate in mm");
  EXPECT_THAT(run(measure + "--length 160 --width 80").error, HasSubstr("are they this plate's?"));
  expect_bad(measure + "--border 70", "plate.ply: --border = 70: must leave some of the plate");
  expect_bad("artefact plate plate.ply --border 5", "--border requires --thickness");
  expect_bad("artefact plate plate.ply --region 0 0 900 50", "plate.ply: --region = 0 0 900 50: ");
  const Outcome ball = run("artefact sphere plate.ply --diameter 80");
  EXPECT_EQ(ball.code, 1);
  EXPECT_THAT(ball.error, HasSubstr("plate.ply: no sphere fits 4941 points"));
  write("ball.ply", ball_of_80_mm());
  const Outcome two = run("artefact sphere ball.ply plate.ply --diameter 80");
  EXPECT_EQ(two.code, 1);
  EXPECT_THAT(two.output, HasSubstr("ball.ply")) << "its figures are printed all the same";
  EXPECT_THAT(two.error, HasSubstr("warning: plate.ply has no result: no sphere fits"));
}

TEST_F(Newcomer, IsToldOfPositionsWithoutAResult) {
  const fs::path out = folder_ / "out";
  for (const char* frame : {"000000", "000001"}) fs::create_directories(out / frame);
  write("out/000000/points.ply", plate());
  write("out/000001/failure.json", R"({"reason": "cam1: black"})");
  const Outcome both = run("artefact plate out --report plate.html --json plate.json");
  EXPECT_EQ(both.code, 1);
  EXPECT_THAT(both.error, HasSubstr("warning: out/000001 has no result: cam1: black"));
  EXPECT_THAT(both.error, HasSubstr("1 of 2 positions have no result"));
  EXPECT_TRUE(fs::exists(folder_ / "plate.html"));
  EXPECT_TRUE(fs::exists(folder_ / "plate.json"));
  const Outcome none = run("artefact plate out/000001");
  EXPECT_EQ(none.code, 1);
  EXPECT_THAT(none.error, HasSubstr("no position has a result; out/000001: cam1: black"));
}

TEST_F(Newcomer, MayJudgeAScanAndIsToldOfAWrongTruth) {
  ASSERT_EQ(run("rig ring --out r.json --cameras 2 --projectors 2 --camera-width 192 "
                "--camera-height 192 --camera-focal-px 345 --projector-width 192 "
                "--projector-height 192")
                .code,
            0);
  write_mesh();
  ASSERT_EQ(run("simulate --rig r.json --mesh mesh.obj --samples 1 --gray-code --out s").code, 0);
  const Outcome scan = run("scan --captures s/captures --rig r.json --out surface --no-mesh");
  ASSERT_EQ(scan.code, 0) << scan.error;
  // A calibrated rig knows no patterns.
  std::string rig = slurp(folder_ / "r.json");
  for (auto at = rig.find(",\n   \"pattern\""); at != std::string::npos;
       at = rig.find(",\n   \"pattern\""))
    rig.erase(at, rig.find('}', at) + 1 - at);
  write("bare.json", rig);
  for (const char* name : {"r.json", "bare.json"}) {
    const Outcome judged = run(std::string("evaluate --result surface/points.ply --rig ") + name +
                               " --truth s/truth/mesh.ply");
    EXPECT_EQ(judged.code, 0) << judged.error;
    EXPECT_THAT(judged.output, HasSubstr("distance_median_mm"));
    EXPECT_THAT(judged.output, Not(HasSubstr("label_error")));
    EXPECT_THAT(judged.error, Not(HasSubstr("warning")));
  }
  // The folder of a run instead of that of a frame.
  write("run/000000/points.ply", "");
  EXPECT_THAT(run("evaluate --result run --rig r.json --truth s/truth/mesh.ply").error,
              HasSubstr("give the folder of a frame, as run/000000"));
  write("small.obj",
        "v -0.6 -0.6 -0.5\nv 0.6 -0.6 -0.5\nv 0 0.7 -0.5\nv 0 0 0.8\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  for (const char* command : {"evaluate --result surface/points.ply", "report ./surface"}) {
    const Outcome judged = run(std::string(command) + " --rig r.json --truth small.obj");
    EXPECT_EQ(judged.code, 0) << judged.error;
    EXPECT_THAT(judged.error, HasSubstr("small.obj: this is hardly the truth of the result"));
    EXPECT_THAT(judged.error, HasSubstr("it is truth/mesh.ply in the scene's folder"));
  }
}

TEST_F(Newcomer, MayBringLightOfAnotherRenderer) {
  ASSERT_EQ(run(small_scene() + "--bits 16 --out own").code, 0);
  const std::string simulate = "simulate --rig r.json --mesh mesh.obj ";
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
    EXPECT_TRUE(fs::exists(folder_ / "made/blender" / file)) << file;
  }
  expect_bad(simulate + "--export-blender --texture stripes --out o", "--texture");
  expect_bad(simulate + "--export-blender --motion-mm-s 5 0 0 --out o", "without --motion-mm-s");
  expect_bad(simulate + "--export-povray --spin-deg-s 0 0 5 --out o", "without --motion-mm-s");
}

TEST_F(Newcomer, KeepsFilmsAndNamesThemAsTheyAre) {
  const std::string film = "sequence export --result none ";
  write("surface.zarr/.zgroup", "{\"zarr_format\":2}");
  expect_bad(film + "--zarr surface.zarr", "--zarr = surface.zarr: is there already");
  expect_bad(film + "--zarr surface.zarr --overwrite", "--result = none");
  expect_bad(film + "--usd film.usdc", "--usd = film.usdc: must end with .usda or .usd");
  expect_bad(film + "--usd film.USDA", "--result = none");
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
