// The parts of a closed surface: sparse lattices, the field of what is inside, marching cubes.

#include "pencilscan/surface/closing.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>

#include "pencilscan/core/parallel.h"
#include "pencilscan/core/random.h"
#include "pencilscan/surface/inside_field.h"
#include "pencilscan/surface/lattice.h"
#include "pencilscan/surface/marching_cubes.h"
#include "pencilscan/surface/smooth_field.h"

namespace pencilscan {
namespace {

Lattice full_lattice(int cells) {
  const auto n = static_cast<std::size_t>(cells);
  return {cells, 1, std::vector<std::uint8_t>(n * n * n, 1)};
}

/// Oriented samples of a ball, evenly spread (Fibonacci's spiral), where `keep` says so.
template <class Keep>
std::vector<SurfaceSample> ball_samples(double radius, int count, Keep keep) {
  std::vector<SurfaceSample> samples;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1) / static_cast<double>(count);
    const double angle = std::numbers::pi * (3 - std::sqrt(5.0)) * i;
    const double r = std::sqrt(1 - z * z);
    SurfaceSample s;
    s.normal = Vec3(r * std::cos(angle), r * std::sin(angle), z);
    s.position = radius * s.normal;
    s.to_camera = s.normal;
    s.sheet_normal = s.normal.unitOrthogonal();
    s.spacing = radius * std::sqrt(4 * std::numbers::pi / count);
    s.confidence = 1;
    s.sigma = 0.01;
    if (keep(s.position)) samples.push_back(s);
  }
  return samples;
}

TEST(Lattice, LinksAreThoseOfASearch) {
  constexpr int kCells = 12;
  constexpr int kBlock = 2;
  Random random(3);
  std::vector<std::uint8_t> marked(6 * 6 * 6);
  for (std::uint8_t& mark : marked) mark = random.uniform() < 0.2 ? 1 : 0;
  const Lattice lattice(kCells, kBlock, marked);
  std::size_t count = 0;
  for (int x = -1; x <= kCells + 1; ++x) {
    for (int y = -1; y <= kCells + 1; ++y) {
      for (int z = -1; z <= kCells + 1; ++z) {
        // A node is there where one of the eight cells around it lies in a marked block.
        bool expected = false;
        for (int corner = 0; corner < 8; ++corner) {
          const int cx = x - (corner & 1), cy = y - (corner >> 1 & 1), cz = z - (corner >> 2);
          if (std::min({cx, cy, cz}) < 0 || std::max({cx, cy, cz}) >= kCells) continue;
          expected = expected || marked[static_cast<std::size_t>(
                                     ((cx / kBlock) * 6 + cy / kBlock) * 6 + cz / kBlock)] != 0;
        }
        const int i = lattice.find(x, y, z);
        ASSERT_EQ(i != Lattice::kNone, expected) << x << " " << y << " " << z;
        if (!expected) continue;
        ++count;
        const auto k = static_cast<std::size_t>(i);
        EXPECT_EQ(lattice.node(k), (Lattice::Node{x, y, z}));
        EXPECT_EQ(lattice.next(0, k), lattice.find(x + 1, y, z));
        EXPECT_EQ(lattice.next(1, k), lattice.find(x, y + 1, z));
        EXPECT_EQ(lattice.next(2, k), lattice.find(x, y, z + 1));
        EXPECT_EQ(lattice.previous(0, k), lattice.find(x - 1, y, z));
        EXPECT_EQ(lattice.previous(1, k), lattice.find(x, y - 1, z));
        EXPECT_EQ(lattice.previous(2, k), lattice.find(x, y, z - 1));
      }
    }
  }
  EXPECT_EQ(count, lattice.size());
  EXPECT_GT(count, 100U);
}

/// Any signs at all give a surface whose every edge has two faces, in opposite directions.
TEST(MarchingCubes, AnySignsGiveAClosedSurface) {
  constexpr int kCells = 10;
  const Lattice lattice = full_lattice(kCells);
  for (const std::uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    std::vector<float> values(lattice.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(random.uniform(-1, 1));
      if (lattice.is_at_wall(i)) values[i] = -1;
    }
    const TriangleMesh mesh = marching_cubes(lattice, values, Vec3::Zero(), 1);
    std::map<std::pair<int, int>, int> sides;
    for (const auto& face : mesh.faces) {
      for (std::size_t k = 0; k < 3; ++k) ++sides[{face[k], face[(k + 1) % 3]}];
    }
    ASSERT_GT(sides.size(), 1000U);
    for (const auto& [side, count] : sides) {
      EXPECT_EQ(count, 1) << "edges of more than two faces";
      EXPECT_TRUE(sides.contains({side.second, side.first}));
    }
    EXPECT_GT(signed_volume(mesh), 0);
  }
}

TEST(MarchingCubes, BallHasItsVolumeAndPlace) {
  constexpr int kCells = 40;
  constexpr double kCell = 0.5, kBall = 7.3;
  const Vec3 origin(-10, -10, -10);
  const Lattice lattice = full_lattice(kCells);
  std::vector<float> values(lattice.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Lattice::Node n = lattice.node(i);
    values[i] = static_cast<float>(kBall - (origin + kCell * Vec3(n[0], n[1], n[2])).norm());
  }
  const TriangleMesh mesh = marching_cubes(lattice, values, origin, kCell);
  const EdgeCounts edges = count_edges(mesh);
  EXPECT_EQ(edges.boundary, 0U);
  EXPECT_EQ(edges.non_manifold, 0U);
  // Chords of a cell's length lie kCell^2 / (8 kBall) below the ball.
  for (const Vec3& x : mesh.vertices) EXPECT_NEAR(x.norm(), kBall, 0.02 * kCell + 0.005);
  const double volume = 4.0 / 3 * std::numbers::pi * kBall * kBall * kBall;
  EXPECT_NEAR(signed_volume(mesh) / volume, 1, 0.005);
}

/// The equations as a dense matrix, solved at once.
TEST(SolveField, IsTheDenseSolution) {
  constexpr int kCells = 6;
  const Lattice lattice = full_lattice(kCells);
  const auto n = static_cast<Eigen::Index>(lattice.size());
  Random random(5);
  FieldData data;
  std::vector<float> values;
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool is_known = random.uniform() < 0.3;
    data.target.push_back(is_known ? static_cast<float>(random.uniform(-0.5, 0.5)) : 0.F);
    data.weight.push_back(is_known ? static_cast<float>(random.uniform(0.1, 1)) : 0.F);
    values.push_back(-0.5F);
  }
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Constant(n, -0.5);
  for (Eigen::Index row = 0; row < n; ++row) {
    const auto i = static_cast<std::size_t>(row);
    if (!lattice.is_inner(i)) continue;
    const auto weight = static_cast<double>(data.weight[i]);
    A(row, row) = 6 + 4 * weight;
    b[row] = 4 * weight * static_cast<double>(data.target[i]);
    for (int axis = 0; axis < 3; ++axis) {
      for (const int k : {lattice.next(axis, i), lattice.previous(axis, i)}) {
        A(row, k) = -1;
        const auto j = static_cast<std::size_t>(k);
        b[row] += static_cast<double>(std::min(data.weight[i], data.weight[j])) *
                  (static_cast<double>(data.target[i]) - static_cast<double>(data.target[j]));
      }
    }
  }
  const Eigen::VectorXd x = A.partialPivLu().solve(b);
  EXPECT_GT(solve_field(lattice, data, 1e-6, values), 0);
  for (Eigen::Index i = 0; i < n; ++i)
    EXPECT_NEAR(static_cast<double>(values[static_cast<std::size_t>(i)]), x[i], 1e-4);
}

TEST(InsideField, BallIsWithinATwentiethOfACell) {
  constexpr double kBall = 20;
  const auto samples = ball_samples(kBall, 6000, [](const Vec3&) { return true; });
  const double cell = samples[0].spacing;
  const InsideField field = inside_field(samples, Vec3::Constant(-32 * cell), cell, 64);
  const TriangleMesh mesh = marching_cubes(field.lattice, field.values, field.origin, field.cell);
  const EdgeCounts edges = count_edges(mesh);
  EXPECT_EQ(edges.boundary + edges.non_manifold, 0U);
  ASSERT_GT(mesh.vertices.size(), 5000U);
  // Neighbours' planes, half a reach away, lie outside of a ball by their distance^2 / (2 radius).
  const double outside = cell * cell / (2 * kBall);
  constexpr double kTolerance = 0.05;  // cells: linear between nodes, and vertices keep off nodes
  for (const Vec3& x : mesh.vertices) {
    EXPECT_LT(x.norm(), kBall + outside + kTolerance * cell);
    EXPECT_GT(x.norm(), kBall - kTolerance * cell);
  }
}

TEST(InsideField, ThinPlateKeepsBothSides) {
  constexpr double kHalf = 16;
  constexpr double kThick = 2.5;  // cells
  std::vector<SurfaceSample> samples;
  for (const double side : {-1.0, 1.0}) {
    for (int x = 0; x < 2 * static_cast<int>(kHalf); ++x) {
      for (int y = 0; y < 2 * static_cast<int>(kHalf); ++y) {
        SurfaceSample s;
        s.position = Vec3(x - kHalf, y - kHalf, 0.5 * side * kThick);
        s.normal = side * Vec3::UnitZ();
        s.spacing = 1;
        samples.push_back(s);
      }
    }
  }
  const InsideField field = inside_field(samples, Vec3::Constant(-32), 1, 64);
  const TriangleMesh mesh = marching_cubes(field.lattice, field.values, field.origin, field.cell);
  std::size_t inner = 0;
  for (const Vec3& x : mesh.vertices) {
    if (x.head<2>().cwiseAbs().maxCoeff() > kHalf - 4) continue;
    ++inner;
    EXPECT_NEAR(std::abs(x.z()), 0.5 * kThick, 0.1) << x.transpose();
  }
  EXPECT_GT(inner, 500U);
}

TEST(ClosedSurface, HoleIsBridgedNearItsRim) {
  constexpr double kBall = 20;
  const auto samples = ball_samples(kBall, 6000, [](const Vec3& x) { return x.z() < 0.9 * kBall; });
  ClosingOptions options;
  options.spacing_mm = options.cell_mm = samples[0].spacing;
  const ClosedSurface closed = closed_surface(samples, options);
  const EdgeCounts edges = count_edges(closed.mesh);
  EXPECT_EQ(edges.boundary + edges.non_manifold, 0U);
  const double rim = std::sqrt(1 - 0.9 * 0.9) * kBall;
  for (const Vec3& x : closed.mesh.vertices) {
    if (x.z() < 0.9 * kBall) {
      EXPECT_LT(x.norm(), 1.1 * kBall);
    } else {
      EXPECT_LT((x - Vec3(0, 0, 0.9 * kBall)).norm(), 1.2 * rim) << x.transpose();
    }
  }
}

TEST(ClosedSurface, AnObjectThatIsOpenBelowEndsOnTheFloor) {
  constexpr double kBall = 20;
  constexpr double kLowest = -6;  // of the samples; a dome that goes on to the floor
  constexpr double kFloor = -8;
  const auto samples = ball_samples(kBall, 6000, [](const Vec3& x) { return x.z() > kLowest; });
  ClosingOptions options;
  options.spacing_mm = options.cell_mm = samples[0].spacing;
  const auto lowest = [](const TriangleMesh& mesh) {
    double z = 0;
    for (const Vec3& x : mesh.vertices) z = std::min(z, x.z());
    return z;
  };
  EXPECT_LT(lowest(closed_surface(samples, options).mesh), kFloor - 2);  // bulges
  options.floor = Floor{{5, 5, kFloor}, Vec3::UnitZ()};
  const TriangleMesh mesh = closed_surface(samples, options).mesh;
  const EdgeCounts edges = count_edges(mesh);
  EXPECT_EQ(edges.boundary + edges.non_manifold, 0U);
  EXPECT_NEAR(lowest(mesh), kFloor, 1e-3);
  std::size_t on_floor = 0;
  for (const Vec3& x : mesh.vertices) {
    const double base = std::sqrt(kBall * kBall - kFloor * kFloor);
    if (x.z() < kFloor + 1e-3 && x.head<2>().norm() < 0.8 * base) ++on_floor;
    if (x.z() > kFloor + options.cell_mm) {
      EXPECT_NEAR(x.norm(), kBall, 0.05 * kBall);
    }
    EXPECT_LT(x.norm(), 1.05 * kBall);
  }
  EXPECT_GT(on_floor, 100U);
}

TEST(ClosedSurface, SameBytesForAnyThreadCount) {
  const auto samples = ball_samples(20, 4000, [](const Vec3& x) { return x.x() < 12; });
  ClosingOptions options;
  options.spacing_mm = options.cell_mm = samples[0].spacing;
  const auto with_threads = [&](int threads) {
    const ThreadLimit limit(threads);
    return closed_surface(samples, options).mesh;
  };
  const TriangleMesh one = with_threads(1);
  const TriangleMesh many = with_threads(4);
  ASSERT_EQ(one.faces, many.faces);
  for (std::size_t v = 0; v < one.vertices.size(); ++v)
    EXPECT_EQ(std::memcmp(one.vertices[v].data(), many.vertices[v].data(), sizeof(Vec3)), 0);
}

}  // namespace
}  // namespace pencilscan
