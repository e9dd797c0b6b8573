#include "pencilscan/io/mesh_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <sstream>

#include "pencilscan/io/curve_file.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/io_fixture.h"
#include "pencilscan/io/mesh_unit.h"
#include "pencilscan/io/ply.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

TEST_F(Io, PlyElementsWithoutPropertiesHaveNoItems) {
  const fs::path file = put("a.ply",
                            "ply\nformat binary_little_endian 1.0\n"
                            "element vertex 1844674407370955161\nend_header\n");
  EXPECT_THAT(error_of([&] { return read_mesh(file); }),
              ::testing::HasSubstr("must have properties"));
}

TEST_F(Io, MeshRoundTripKeepsVerticesAndSigma) {
  TriangleMesh box = make_box({10, 20, 30});
  box.sigma.assign(box.vertices.size(), 0.5F);
  write_mesh(folder_ / "m.ply", box);
  const TriangleMesh back = read_mesh(folder_ / "m.ply");
  EXPECT_EQ(back.faces, box.faces);
  EXPECT_EQ(back.sigma, box.sigma);
  EXPECT_TRUE(back.confidence.empty());
  EXPECT_DOUBLE_EQ(signed_volume(back), 6000);
}

TEST_F(Io, MeshRoundTripKeepsReasonsOfHolesAndColors) {
  TriangleMesh box = make_box({10, 20, 30});
  for (std::size_t i = 0; i < box.vertices.size(); ++i) {
    box.hole.push_back(static_cast<std::uint8_t>(i));
    box.color.push_back({0.02F * static_cast<float>(i), 0.5F, 1.0F});
  }
  write_mesh(folder_ / "m.ply", box);
  const TriangleMesh back = read_mesh(folder_ / "m.ply");
  EXPECT_EQ(back.hole, box.hole);
  ASSERT_EQ(back.color.size(), box.color.size());
  constexpr float kHalfAStep = 0.0045F;  // of 8 bits, where sRGB is steepest in linear light
  for (std::size_t i = 0; i < box.color.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(back.color[i][k], box.color[i][k], kHalfAStep);
  }
}

TEST_F(Io, ObjCoordinatesMayBeginWithAPoint) {
  const TriangleMesh mesh =
      read_mesh(put("t.obj",
                    "v -.5 0 0 # left\r\nv +.5 1e-3 0\nv\t0  .75 -0.\nv 0 0 \\\n.25 .9 .9 .9#top\n"
                    "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"));
  ASSERT_EQ(mesh.vertices.size(), 4U);
  EXPECT_EQ(mesh.faces.size(), 4U);
  EXPECT_EQ(mesh.vertices[0].x(), -0.5);
  EXPECT_EQ(mesh.vertices[1].y(), 0.75);  // in the order of the faces
  for (const char* word : {"nan", "inf", "1.2.3", "x"})
    EXPECT_NE(error_of([&] {
                return read_mesh(
                    put("b.obj", std::string("v 1 0 0\nv 0 ") + word + " 0\nv 0 0 1\nf 1 2 3\n"));
              }).find("line 2 = " + std::string(word)),
              std::string::npos)
        << word;
}

TEST_F(Io, ObjLinesGoOnBehindABackslash) {
  // As Windows ends them, with a blank behind, in faces, and not out of a comment.
  const TriangleMesh mesh = read_mesh(
      put("t.obj",
          "# C:\\models\\\r\nv 0 0 0\r\nv 6 \\\r\n0 0\r\nv 0 6 \\ \n0 # last \\\nv 0 0 6\n"
          "f 1 3 \\\r\n2\r\nf 1 2 4\nf 1 4 3\nf 2 \\\n3 4\n"));
  EXPECT_EQ(mesh.vertices.size(), 4U);
  EXPECT_NEAR(signed_volume(mesh), 36, 1e-9);
  EXPECT_THAT(
      error_of([&] { return read_mesh(put("b.obj", "v 1 \\\r\n0 0\r\nv x 0 0\r\nf 1 1 1\n")); }),
      ::testing::HasSubstr("line 3 = x"));
}

/// An L of 80 mm with legs of 20 mm, 40 mm high: two of its polygons are not convex.
std::string l_shaped(bool as_ply, std::size_t first) {
  const std::array<std::array<int, 2>, 6> outline{
      {{0, 0}, {80, 0}, {80, 20}, {20, 20}, {20, 80}, {0, 80}}};
  std::string vertices;
  for (const char* z : {" 0\n", " 40\n"}) {
    for (std::size_t i = 0; i < 6; ++i) {
      const auto& at = outline[(first + i) % 6];
      vertices += std::to_string(at[0]) + " " + std::to_string(at[1]) + z;
    }
  }
  std::string faces = "6 5 4 3 2 1 0\n6 6 7 8 9 10 11\n";
  for (int i = 0; i < 6; ++i) {
    const int next = (i + 1) % 6;
    for (const int corner : {4, i, next, next + 6}) faces += std::to_string(corner) + " ";
    faces += std::to_string(i + 6) + "\n";
  }
  if (!as_ply) return "OFF\n12 8 0\n" + vertices + faces;
  return "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\n"
         "property float z\nelement face 8\nproperty list uchar int vertex_indices\nend_header\n" +
         vertices + faces;
}

TEST_F(Io, PolygonsThatAreNotConvexAreCoveredOnce) {
  constexpr double kAreaMm2 = 2 * 2800 + 40 * 320;  // both ends, and all around
  for (std::size_t first = 0; first < 6; ++first) {
    for (const char* name : {"l.ply", "l.off"}) {
      const TriangleMesh mesh = read_mesh(put(name, l_shaped(std::string(name) == "l.ply", first)));
      EXPECT_EQ(mesh.faces.size(), 20U);
      EXPECT_EQ(count_edges(mesh).boundary, 0U);
      EXPECT_NEAR(surface_area(mesh), kAreaMm2, 1e-6) << name << ", corner " << first;
      EXPECT_NEAR(signed_volume(mesh), 40 * 2800, 1e-6) << name << ", corner " << first;
    }
  }
}

TEST_F(Io, ObjMayHoldWhatOtherProgramsPutThere) {
  const TriangleMesh mesh =
      read_mesh(put("t.obj",
                    "\xEF\xBB\xBFv 0 0 0 1 0 0 1\n  v +6 0 0 .5 .5 .5\nv 0 6E+0 0 1 1 1\n"
                    "v 0 0 6 0 0 0\nf 1 3 2 # bottom\nf 1 2 4#left\n  f 1 4 3\nf 2 3 4\n"));
  EXPECT_EQ(mesh.vertices.size(), 4U);
  EXPECT_NEAR(signed_volume(mesh), 36, 1e-9);
  EXPECT_THAT(error_of([&] { return read_mesh(put("b.obj", "v 1 0 0\nv 0 1\nf 1 2 1\n")); }),
              ::testing::HasSubstr("line 2 = v 0 1: must be a vertex"));
}

TEST_F(Io, OffThatIsCutOrPointsNowhereIsRefused) {
  const std::string vertices = "0 0 0\n6 0 0 # right\n\n0 6 0\n0 0 6\n";
  const std::string faces = "3 0 2 1\n3 0 1 3\n3 0 3 2 255 0 0\n3 1 2 3\n";
  EXPECT_NEAR(signed_volume(read_mesh(put("a.off", "4 4\n" + vertices + faces))), 36, 1e-9);
  EXPECT_NEAR(signed_volume(read_mesh(put("b.off", "# x\nCOFF 4 4 6\r\n" + vertices + faces))), 36,
              1e-9);
  const auto error = [&](const std::string& text) {
    return error_of([&] { return read_mesh(put("c.off", text)); });
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(error("OFF\n4 4 0\n" + vertices + faces.substr(0, 16)), HasSubstr("truncated OFF"));
  EXPECT_THAT(error("OFF\n4 4 0\n" + vertices + "3 0 2 4\n"), HasSubstr("line 8 = 4"));
  EXPECT_THAT(error("OFF\n4 4 0\n" + vertices + "3 0 2\n"), HasSubstr("line 8 = 3 corners"));
  EXPECT_THAT(error("OFF\n4 4 0\n" + vertices + "3 0 -1 2\n"), HasSubstr("line 8 = -1"));
  EXPECT_THAT(error("OFF\n4 4 0\n0 0 x\n"), HasSubstr("line 3 = x"));
  EXPECT_THAT(error("4OFF\n4 4 0\n"), HasSubstr("three dimensions"));
  EXPECT_THAT(error("OFF BINARY\n"), HasSubstr("as text"));
}

TEST_F(Io, StlMayShoutAndEndLateButHoldsWhatItSays) {
  std::string text = "SOLID t\n";
  for (const char* facet :
       {"0 0 0|0 6 0|6 0 0", "0 0 0|6 0 0|0 0 6", "0 0 0|0 0 6|0 6 0", "6 0 0|0 6 0|0 0 6"}) {
    text += "FACET NORMAL 0 0 0\nOUTER LOOP\n";
    std::istringstream corners(facet);
    for (std::string corner; std::getline(corners, corner, '|');) text += "VERTEX " + corner + "\n";
    text += "ENDLOOP\nENDFACET\n";
  }
  EXPECT_NEAR(signed_volume(read_mesh(put("t.stl", text + "ENDSOLID t\n"))), 36, 1e-9);
  export_mesh(folder_ / "box.stl", make_box({1, 2, 3}));
  const std::string box = read_file(folder_ / "box.stl");
  EXPECT_NEAR(signed_volume(read_mesh(put("late.stl", box + "made by x"))), 6, 1e-5);
  for (const std::string& wrong : {box.substr(0, box.size() - 60), box + box}) {
    EXPECT_THAT(error_of([&] { return read_mesh(put("b.stl", wrong)); }),
                ::testing::HasSubstr("number of facets = 12"));
  }
}

TEST_F(Io, ObjStlAndOffGiveOneClosedTetrahedron) {
  const auto obj = put("t.obj",
                       "v 0 0 0\nv 6 0 0\nv 0 6 0\nv 0 0 6\nvn 0 0 1\nf 1//1 3//1 2//1\n"
                       "f 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const auto off = put("t.off",
                       "OFF\n4 4 0\n0 0 0\n6 0 0\n0 6 0\n0 0 6\n3 0 2 1\n3 0 1 3\n"
                       "3 0 3 2\n3 1 2 3\n");
  std::string stl = "solid t\n";
  const char* corners[] = {"0 0 0", "6 0 0", "0 6 0", "0 0 6"};
  for (const auto& face : {std::array{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const int corner : face) stl += std::string("vertex ") + corners[corner] + "\n";
    stl += "endloop\nendfacet\n";
  }
  for (const auto& path : {obj, off, put("t.stl", stl + "endsolid t\n")}) {
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.vertices.size(), 4U) << path;
    EXPECT_EQ(count_edges(mesh).boundary, 0U) << path;
    EXPECT_NEAR(signed_volume(mesh), 36, 1e-9) << path;
  }
}

/// Exporters write so what has no shared vertices; shading would show every face.
TEST_F(Io, PlyOfFacesWithVerticesOfTheirOwnIsJoined) {
  const TriangleMesh ball = make_sphere(30, 8);
  TriangleMesh split;
  for (const auto& face : ball.faces) {
    const int first = static_cast<int>(split.vertices.size());
    for (const int corner : face) {
      split.vertices.push_back(ball.vertices[static_cast<std::size_t>(corner)]);
      split.confidence.push_back(static_cast<float>(corner));
    }
    split.faces.push_back({first, first + 1, first + 2});
  }
  write_mesh(folder_ / "split.ply", split);
  const TriangleMesh read = read_mesh(folder_ / "split.ply");
  EXPECT_EQ(read.vertices.size(), ball.vertices.size());
  EXPECT_EQ(read.faces.size(), ball.faces.size());
  EXPECT_EQ(count_edges(read).boundary, 0U);
  ASSERT_EQ(read.confidence.size(), read.vertices.size());
  for (std::size_t i = 0; i < read.vertices.size(); ++i) {
    const auto corner = static_cast<std::size_t>(read.confidence[i]);
    EXPECT_LT((read.vertices[i] - ball.vertices[corner]).norm(), 1e-5);
  }
  // Two vertices at one place are meant where faces share others: seams, and surfaces that touch.
  TriangleMesh seam = make_box(Vec3(1, 2, 3));
  seam.vertices.push_back(seam.vertices[0]);
  seam.faces[0][0] = static_cast<int>(seam.vertices.size()) - 1;
  write_mesh(folder_ / "seam.ply", seam);
  EXPECT_EQ(read_mesh(folder_ / "seam.ply").vertices.size(), 9U);
}

TEST_F(Io, ExportedMeshesAreReadBack) {
  const TriangleMesh ball = make_sphere(30, 8, Vec3(5, 6, 7));
  for (const char* name : {"ball.obj", "ball.stl"}) {
    export_mesh(folder_ / name, ball);
    const TriangleMesh read = read_mesh(folder_ / name);
    EXPECT_EQ(read.vertices.size(), ball.vertices.size()) << name;
    EXPECT_EQ(count_edges(read).boundary, 0U) << name;
    // Nine digits in the text, floats in the binary file.
    EXPECT_NEAR(signed_volume(read), signed_volume(ball), 1e-4 * signed_volume(ball)) << name;
  }
  EXPECT_THROW(export_mesh(folder_ / "ball.xyz", ball), InputError);
}

TEST_F(Io, ObjKeepsSmallVerticesApart) {
  const TriangleMesh ball = make_sphere(3e-5, 8, Vec3(0.5, -0.25, 0));  // of a ring in metres
  export_mesh(folder_ / "ball.obj", ball, false);
  const TriangleMesh read = read_mesh(folder_ / "ball.obj");
  EXPECT_EQ(read.vertices.size(), ball.vertices.size());
  EXPECT_EQ(read.faces.size(), ball.faces.size());
}

TEST_F(Io, MeshesSayTheirUnit) {
  const TriangleMesh box = make_box(Vec3(1, 2, 3));
  const auto bytes_of = [&](const char* name, bool unit_known) {
    if (std::string_view(name).ends_with(".ply")) {
      write_mesh(folder_ / name, box, unit_known);
    } else {
      export_mesh(folder_ / name, box, unit_known);
    }
    return read_file(folder_ / name);
  };
  for (const char* name : {"b.ply", "b.obj", "b.stl"}) {
    for (const bool known : {false, true}) {
      (void)bytes_of(name, known);
      EXPECT_EQ(mesh_unit_known(folder_ / name), known) << name;
    }
  }
  using ::testing::HasSubstr;
  using ::testing::StartsWith;
  EXPECT_THAT(bytes_of("b.ply", true), HasSubstr("\ncomment unit mm, world frame of rig.json\n"));
  EXPECT_THAT(bytes_of("b.ply", false), HasSubstr("\ncomment unit unknown, world frame of"));
  EXPECT_THAT(bytes_of("b.obj", true), StartsWith("# unit mm\n"));
  EXPECT_THAT(bytes_of("b.obj", false), StartsWith("# unit unknown\n"));
  EXPECT_THAT(bytes_of("b.stl", true), StartsWith("binary STL, unit mm "));
  EXPECT_THAT(bytes_of("b.stl", false), StartsWith("binary STL, unit unknown "));
  EXPECT_THAT(bytes_of("b.glb", true), ::testing::Not(HasSubstr("unknown")));
  const std::string glb = bytes_of("b.glb", false);
  EXPECT_THAT(glb, HasSubstr("\"extras\":{\"unit\":\"unknown\"}"));
  EXPECT_THAT(glb, HasSubstr("\"max\":[0.5,1.5,1.0]"));  // numbers of the mesh, y up
}

TEST_F(Io, GlbIsInMetresWithYUp) {
  const TriangleMesh box = make_box(Vec3(100, 200, 300), Vec3(0, 0, 150));
  export_mesh(folder_ / "box.glb", box);
  const std::string bytes = read_file(folder_ / "box.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t k = 4; k-- > 0;)
      value = value << 8U | static_cast<std::uint8_t>(bytes[at + k]);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  const std::uint32_t text = word(12);
  EXPECT_EQ(text % 4, 0U);
  const auto root = nlohmann::json::parse(bytes.substr(20, text));
  EXPECT_EQ(word(20 + text) % 4, 0U);
  const auto& position = root["accessors"][0];
  EXPECT_NEAR(position["max"][1].get<double>(), 0.3, 1e-6);  // world z
  EXPECT_NEAR(position["min"][1].get<double>(), 0, 1e-6);
  EXPECT_NEAR(position["max"][2].get<double>(), 0.1, 1e-6);  // world -y
  EXPECT_EQ(root["accessors"][2]["count"], 3 * box.faces.size());
  EXPECT_GE(root["buffers"][0]["byteLength"], 24 * box.vertices.size() + 12 * box.faces.size());
}

TEST_F(Io, UnusableMeshesAreRejected) {
  const std::string vertices =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face ";
  const std::string list = "\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_THAT(error_of([&] {
                return read_mesh(put("a.ply", vertices + "0" + list + "0 0 0\n1 0 0\n0 1 0\n"));
              }),
              ::testing::HasSubstr("must have faces"));
  EXPECT_THAT(
      error_of([&] {
        return read_mesh(put("b.ply", vertices + "1" + list + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"));
      }),
      ::testing::HasSubstr("face[0] = 3"));
  EXPECT_THAT(
      error_of([&] {
        return read_mesh(put("c.ply", vertices + "1" + list + "0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"));
      }),
      ::testing::HasSubstr("vertex[1]: coordinates must be finite"));
  EXPECT_NE(error_of([&] { return read_mesh(put("d.obj", "nothing here")); }), "");
  EXPECT_NE(error_of([&] { return read_mesh(put("e.txt", "x")); }), "");
}

TEST_F(Io, CurvesComeBackAsWritten) {
  CurveFile curves;
  for (int i = 0; i < 3; ++i) {
    CurveSample sample;
    sample.u = 10.25F + static_cast<float>(i);
    sample.v = 7.5F;
    sample.sigma_px = 0.07F;
    sample.amplitude = 0.4F;
    sample.camera = 5;
    sample.curve = 70'000;
    sample.family = 1;
    sample.color = 1;
    sample.color_lead = 3.5F;
    sample.state = static_cast<CurveState>(i);
    sample.projector = 4;
    sample.pattern = 1;
    sample.line = 300;
    sample.confidence = 0.875F;
    curves.samples.push_back(sample);
  }
  curves.crossings.push_back({1.5F, 2.5F, 5, 3, 70'000});
  write_curves(folder_ / "curves.ply", curves);
  const CurveFile read = read_curves(folder_ / "curves.ply");
  ASSERT_EQ(read.samples.size(), 3U);
  const CurveSample& last = read.samples[2];
  EXPECT_EQ(last.u, 12.25F);
  EXPECT_EQ(last.sigma_px, 0.07F);
  EXPECT_EQ(last.amplitude, 0.4F);
  EXPECT_EQ(last.camera, 5);
  EXPECT_EQ(last.curve, 70'000U);
  EXPECT_EQ(last.family, 1);
  EXPECT_EQ(last.color_lead, 3.5F);
  EXPECT_EQ(last.state, CurveState::kAmbiguous);
  EXPECT_EQ(last.projector, 4);
  EXPECT_EQ(last.line, 300);
  EXPECT_EQ(last.confidence, 0.875F);
  ASSERT_EQ(read.crossings.size(), 1U);
  EXPECT_EQ(read.crossings[0].curve_b, 70'000U);
  const PlyFile file = read_ply(folder_ / "curves.ply");
  const PlyElement* edges = file.find("edge");
  ASSERT_NE(edges, nullptr);
  EXPECT_THAT(edges->find("vertex1")->values, ::testing::ElementsAre(0, 1));
  EXPECT_THAT(edges->find("vertex2")->values, ::testing::ElementsAre(1, 2));
}

TEST_F(Io, CurvesWithStatesThatDoNotExistAreRefused) {
  CurveFile curves;
  curves.samples.resize(1);
  curves.samples[0].state = static_cast<CurveState>(9);
  write_curves(folder_ / "curves.ply", curves);
  EXPECT_THAT(error_of([&] { return read_curves(folder_ / "curves.ply"); }),
              ::testing::HasSubstr("vertex[0].state"));
  write_mesh(folder_ / "box.ply", make_box({1, 1, 1}));
  EXPECT_THAT(error_of([&] { return read_curves(folder_ / "box.ply"); }),
              ::testing::HasSubstr("`crossing`"));
}

}  // namespace
}  // namespace pencilscan
