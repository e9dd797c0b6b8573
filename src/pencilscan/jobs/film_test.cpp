#include "pencilscan/jobs/film.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/io/zarr_array.h"
#include "pencilscan/pipeline/run_folder.h"
#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Three frames: a box, nothing, a ball.
class Films : public ::testing::Test {
 protected:
  void SetUp() override {
    write_run_inputs(out(), {"p", "r", "o", "", {"000000", "000001", "000002"}});
    write("000000", make_box({2, 4, 6}));
    write("000002", make_sphere(10, 8));
  }
  void write(const std::string& frame, TriangleMesh mesh) {
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      mesh.sigma.push_back(0.01F);
      mesh.confidence.push_back(i == 0 ? 0.0F : 0.9F);
      mesh.color.push_back({0.1F, 0.2F, 0.3F});
    }
    write_mesh(out() / frame / "mesh.ply", mesh);
  }
  [[nodiscard]] fs::path out() const { return temporary_.path() / "out"; }

  TemporaryFolder temporary_{std::string("film_") +
                             ::testing::UnitTest::GetInstance()->current_test_info()->name()};
};

TEST_F(Films, PythonOpensTheSurfaces) {
  const fs::path folder = temporary_.path() / "surface.zarr";
  const Film film = find_film(out(), false);
  write_film_zarr(film, folder);
  write_film_zarr(film, folder);  // replaces its own
  EXPECT_FALSE(fs::exists(folder.string() + ".partial"));
  const TriangleMesh ball = read_mesh(film.mesh_file(2));
  const ZarrArray faces = read_zarr_array(folder / "000002" / "faces");
  EXPECT_EQ(faces.shape[0], static_cast<std::int64_t>(ball.faces.size()));
  EXPECT_FALSE(fs::exists(folder / "000001"));
  if (std::system("/usr/bin/python3 -c 'import zarr' 2> /dev/null") != 0)
    GTEST_SKIP() << "python3-zarr is not installed";
  const std::string code =
      "import zarr, sys\n"
      "g = zarr.open(sys.argv[1], 'r')\n"
      "assert g.attrs['frames'] == ['000000', '000001', '000002']\n"
      "assert sorted(g.group_keys()) == ['000000', '000002']\n"
      "f = g['000000']\n"
      "assert f['vertices'].shape == (8, 3) and f['vertices'].dtype == '<f4'\n"
      "assert f['faces'].shape == (12, 3) and f['faces'].dtype == '<i4'\n"
      "assert f['faces'][:].min() == 0 and f['faces'][:].max() == 7\n"
      "assert abs(f['vertices'][:]).max(axis=0).tolist() == [1, 2, 3]\n"
      "assert f['measured'][:].tolist() == [0] + 7 * [1]\n"
      "assert abs(f['sigma'][:] - .01).max() < 1e-6\n";
  write_text(temporary_.path() / "look.py", code);
  EXPECT_EQ(std::system(("/usr/bin/python3 '" + (temporary_.path() / "look.py").string() + "' '" +
                         folder.string() + "'")
                            .c_str()),
            0);
}

TEST_F(Films, AnEarlierFilmIsReplacedByANameThatEndsWithASlash) {
  const fs::path folder = temporary_.path() / "surface.zarr";
  const Film film = find_film(out(), false);
  write_film_zarr(film, folder);
  write_text(folder / "old.txt", "of the earlier film");
  write_film_zarr(film, folder / "");
  EXPECT_TRUE(is_zarr_group(folder));
  EXPECT_TRUE(fs::exists(folder / "000002" / "faces"));
  EXPECT_FALSE(fs::exists(folder / "old.txt"));
  EXPECT_FALSE(fs::exists(folder.string() + ".partial"));
  EXPECT_FALSE(fs::exists(folder / ".partial"));
}

TEST_F(Films, AnEarlierFilmStaysWhereTheNewOneFails) {
  const fs::path folder = temporary_.path() / "surface.zarr";
  const Film film = find_film(out(), false);
  write_film_zarr(film, folder);
  write_text(film.mesh_file(2), "no mesh");
  EXPECT_THROW(write_film_zarr(film, folder / ""), InputError);
  EXPECT_TRUE(fs::exists(folder / "000002" / "faces"));
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST_F(Films, UsdHasATimeSampleAFrame) {
  const fs::path file = temporary_.path() / "film.usda";
  write_film_usd(find_film(out(), false), 30, file);
  const std::string text = read_file(file);
  EXPECT_THAT(text, ::testing::StartsWith("#usda 1.0\n"));
  EXPECT_THAT(text, HasSubstr("endTimeCode = 2\n"));
  EXPECT_THAT(text, HasSubstr("timeCodesPerSecond = 30\n"));
  EXPECT_THAT(text, HasSubstr("0: [(-1, -2, -3), (1, 2, 3)],"));
  EXPECT_EQ(count_of(text, ".timeSamples = {"), 6U);
  EXPECT_EQ(count_of(text, "\n        1: [],"), 6U);
  EXPECT_EQ(count_of(text, "{"), count_of(text, "}"));
  // 12 triangles of the box and those of the ball.
  const std::size_t ball = read_mesh(out() / "000002" / "mesh.ply").faces.size();
  const auto counts = text.find("faceVertexCounts.timeSamples");
  const std::string part = text.substr(counts, text.find('}', counts) - counts);
  EXPECT_EQ(count_of(part, "3"), 12 + ball);
}

TEST_F(Films, AFrameWithoutColorsIsWhiteAmongOthers) {
  TriangleMesh box = make_box({2, 4, 6});
  box.sigma.assign(box.vertices.size(), 0.01F);
  write_mesh(out() / "000000" / "mesh.ply", box);
  const fs::path file = temporary_.path() / "film.usda";
  write_film_usd(find_film(out(), false), 30, file);
  const std::string text = read_file(file);
  const auto colors = text.find("primvars:displayColor.timeSamples");
  ASSERT_NE(colors, std::string::npos);
  EXPECT_EQ(count_of(text.substr(colors), "(1, 1, 1)"), box.vertices.size());
  EXPECT_GT(count_of(text.substr(colors), "(0."), 0U);
}

TEST_F(Films, AFilmWithoutColorsHasNone) {
  for (const char* frame : {"000000", "000002"})
    write_mesh(out() / frame / "mesh.ply", make_box({2, 4, 6}));
  const fs::path file = temporary_.path() / "film.usda";
  write_film_usd(find_film(out(), false), 30, file);
  EXPECT_EQ(count_of(read_file(file), "displayColor"), 0U);
}

TEST_F(Films, ARigOfUnknownUnitGivesOne) {
  const fs::path file = temporary_.path() / "film.usda";
  Rig rig = sample::small_rig(480, 360, 110);
  write_rig(rig, out() / "devices.json");
  write_film_usd(find_film(out(), false), 30, file);
  EXPECT_THAT(read_file(file), HasSubstr("    metersPerUnit = 0.001\n    startTimeCode"));
  rig.unit_known = false;
  write_rig(rig, out() / "devices.json");
  write_film_usd(find_film(out(), false), 30, file);
  EXPECT_THAT(read_file(file), HasSubstr("    metersPerUnit = 1\n    customLayerData = {\n"
                                         "        string unit = \"unknown\"\n    }\n"));
}

TEST_F(Films, WhatIsNoFilmIsRefusedAndNothingElseReplaced) {
  EXPECT_THROW((void)find_film(temporary_.path(), false), InputError);
  EXPECT_THROW((void)find_film(out(), true), InputError);  // no mesh_measured.ply
  const fs::path other = temporary_.path() / "other";
  write_text(other / "mine.txt", "mine");
  EXPECT_THROW(write_film_zarr(find_film(out(), false), other), InputError);
  EXPECT_EQ(read_file(other / "mine.txt"), "mine");
}

}  // namespace
}  // namespace pencilscan
