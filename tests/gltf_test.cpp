// Exported GLB files before Khronos' validator (tests/gltf, installed by script/bootstrap).
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "pencilscan/io/file.h"
#include "pencilscan/io/mesh_file.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

class Gltf : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v node >/dev/null 2>&1") != 0) GTEST_SKIP() << "there is no node";
    folder_ = fs::temp_directory_path() / ("pencilscan_gltf_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Empty when the validator finds neither errors nor warnings, or else what it says.
  [[nodiscard]] std::string complaint(const TriangleMesh& mesh) const {
    const fs::path glb = folder_ / "mesh.glb";
    const fs::path said = folder_ / "said.txt";
    export_mesh(glb, mesh);
    const std::string command = "node '" PENCILSCAN_SOURCE_DIR "/tests/gltf/validate.js' '" +
                                glb.string() + "' > '" + said.string() + "' 2>&1";
    return std::system(command.c_str()) == 0 ? "" : read_file(said);
  }

  fs::path folder_;
};

TEST_F(Gltf, PlainMeshIsValid) { EXPECT_EQ(complaint(make_sphere(50)), ""); }

TEST_F(Gltf, ColoredMeshIsValid) {
  TriangleMesh mesh = make_sphere(50);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const float share = static_cast<float>(v) / static_cast<float>(mesh.vertices.size());
    mesh.color.push_back({share, 1 - share, 1.5F * share});  // beyond 1: limited
  }
  EXPECT_EQ(complaint(mesh), "");
}

TEST_F(Gltf, VerticesWithoutAreaAreValid) {
  TriangleMesh mesh = make_box(Vec3(1, 2, 3));
  mesh.vertices.push_back(mesh.vertices[0]);
  const int twin = static_cast<int>(mesh.vertices.size()) - 1;
  mesh.faces.push_back({0, 1, twin});
  EXPECT_EQ(complaint(mesh), "");
}

TEST_F(Gltf, BrokenFilesAreNotedByTheValidator) {
  TriangleMesh mesh = make_box(Vec3(1, 2, 3));
  mesh.vertices[0].x() = std::nan("");
  EXPECT_NE(complaint(mesh), "");
}

}  // namespace
}  // namespace pencilscan
