#include "pencilscan/surface/inside_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "pencilscan/core/check.h"
#include "pencilscan/core/chunks.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/surface/smooth_field.h"

namespace pencilscan {
namespace {

constexpr int kCoarsest = 32;  // cells of a cube's side that every node of it can be afforded
/// Cells that a sample reaches along its normal. Two cells of the sign's change are left on each
/// side of the surface, as many as linear interpolation between nodes needs, and one beyond.
constexpr double kReach = 2;
constexpr double kStep = 3;            // cells, from -1/2 to 1/2
constexpr double kSpacingReach = 1.5;  // spacings along the surface: the next samples lie within
/// Of the field, root mean square: a vertex is off by three thousandths of a cell then. What is
/// wrong over a whole cube shows in a node's neighbours by cells^-2 of it.
constexpr double kTolerance = 1e-3;
constexpr double kCoarsestTolerance = 1e-5;

/// Samples of one cell whose normals point the same way.
struct Patch {
  Vec3 position = Vec3::Zero();  ///< cells
  Vec3 normal = Vec3::Zero();    ///< unit
  double weight = 0;             ///< number of samples
  double spacing = 0;            ///< cells
};

/// Puts patches of one cell and one main direction of the normal together.
std::vector<Patch> merged(const std::vector<Patch>& patches, int cells) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(patches.size());
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const Patch& p = patches[i];
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int at = std::clamp(static_cast<int>(p.position[axis]), 0, cells - 1);
      key = key * static_cast<std::uint64_t>(cells) + static_cast<std::uint64_t>(at);
    }
    Eigen::Index axis = 0;
    p.normal.cwiseAbs().maxCoeff(&axis);
    const std::uint64_t direction =
        2 * static_cast<std::uint64_t>(axis) + (p.normal[axis] > 0 ? 1U : 0U);
    order[i] = {6 * key + direction, static_cast<std::uint32_t>(i)};
  }
  std::sort(order.begin(), order.end());
  std::vector<Patch> result;
  for (std::size_t i = 0; i < order.size();) {
    Patch sum;
    const std::uint64_t key = order[i].first;
    for (; i < order.size() && order[i].first == key; ++i) {
      const Patch& p = patches[order[i].second];
      sum.position += p.weight * p.position;
      sum.normal += p.weight * p.normal;
      sum.weight += p.weight;
      sum.spacing = std::max(sum.spacing, p.spacing);
    }
    sum.position /= sum.weight;
    sum.normal.normalize();
    result.push_back(sum);
  }
  return result;
}

std::vector<Patch> patches_of(std::span<const SurfaceSample> samples, const Vec3& origin,
                              double cell) {
  std::vector<Patch> patches;
  patches.reserve(samples.size());
  for (const SurfaceSample& s : samples)
    patches.push_back({(s.position - origin) / cell, s.normal, 1, s.spacing / cell});
  return patches;
}

/// In cells of twice the size.
std::vector<Patch> coarser(std::vector<Patch> patches, int cells) {
  for (Patch& p : patches) {
    p.position /= 2;
    p.spacing /= 2;
  }
  return merged(patches, cells);
}

double reach_along(const Patch& p) { return std::max(kReach, kSpacingReach * p.spacing); }

/// Sums over the patches that reach a node.
struct Said {
  float weight = 0;
  float step = 0;
  float step2 = 0;
};

/// Adds what a patch says to the nodes of the columns [x0, x1).
void say(const Patch& p, const Lattice& lattice, int x0, int x1, std::vector<Said>& said) {
  const double along = reach_along(p);
  const double longest = std::max(along, kReach);
  const auto first = [&](int axis) {
    return std::max(0, static_cast<int>(std::ceil(p.position[axis] - longest)));
  };
  const auto last = [&](int axis) {
    return std::min(lattice.cells(), static_cast<int>(std::floor(p.position[axis] + longest)));
  };
  const auto inverse_along2 = static_cast<float>(1 / (along * along));
  const auto inverse_off2 = static_cast<float>(1 / (kReach * kReach));
  const Eigen::Vector3f n = p.normal.cast<float>();
  const auto weight = static_cast<float>(p.weight);
  for (int x = std::max(x0, first(0)); x <= std::min(x1 - 1, last(0)); ++x) {
    for (int y = first(1); y <= last(1); ++y) {
      const auto [begin, end] = lattice.column(x, y);
      if (begin == end) continue;
      const auto dx = static_cast<float>(x - p.position[0]);
      const auto dy = static_cast<float>(y - p.position[1]);
      const int low = first(2);
      const int high = last(2);
      std::size_t i = begin;
      for (std::size_t count = end - begin; count > 0;) {  // the first node with z >= low
        const std::size_t half = count / 2;
        if (lattice.z(i + half) < low) {
          i += half + 1;
          count -= half + 1;
        } else {
          count = half;
        }
      }
      for (; i < end && lattice.z(i) <= high; ++i) {
        const auto dz = static_cast<float>(lattice.z(i) - p.position[2]);
        const float height = dx * n[0] + dy * n[1] + dz * n[2];
        const float height2 = height * height;
        const float apart2 = dx * dx + dy * dy + dz * dz - height2;
        const float left = 1 - apart2 * inverse_along2 - height2 * inverse_off2;
        if (left <= 0) continue;
        const float k = weight * left * left;
        const float step = std::clamp(-height / static_cast<float>(kStep), -0.5F, 0.5F);
        said[i].weight += k;
        said[i].step += k * step;
        said[i].step2 += k * step * step;
      }
    }
  }
}

/// Weight of samples that lie a spacing apart all around: the integral of (1 - r^2)^2 over a disc
/// of kSpacingReach spacings. A lone sample has less: it may be wrong.
const auto kWhole = static_cast<float>(std::numbers::pi / 3 * kSpacingReach * kSpacingReach);

/// What the patches say of each node.
FieldData data_of(const std::vector<Patch>& patches, const Lattice& lattice) {
  constexpr int kSlab = 4;  // planes of nodes
  std::vector<Said> said(lattice.size());
  double longest = kReach;
  for (const Patch& p : patches) longest = std::max(longest, reach_along(p));
  const auto slabs = static_cast<std::size_t>(lattice.cells() / kSlab + 1);
  parallel_for(slabs, [&](std::size_t slab) {
    const int x0 = static_cast<int>(slab) * kSlab;
    const int x1 = std::min(x0 + kSlab, lattice.cells() + 1);
    // Patches are in order of the cell's x.
    const auto begin =
        std::lower_bound(patches.begin(), patches.end(), x0 - longest - 1,
                         [](const Patch& p, double x) { return std::floor(p.position[0]) < x; });
    for (auto p = begin; p != patches.end() && std::floor(p->position[0]) <= x1 + longest; ++p)
      say(*p, lattice, x0, x1, said);
  });
  FieldData data;
  data.target.resize(said.size());
  data.weight.resize(said.size());
  for (std::size_t i = 0; i < said.size(); ++i) {
    if (!(said[i].weight > 0)) continue;
    const float mean = said[i].step / said[i].weight;
    // Of values in [-1/2, 1/2] the variance is at most 1/4.
    const float variance = std::clamp(said[i].step2 / said[i].weight - mean * mean, 0.F, 0.25F);
    data.target[i] = mean;
    data.weight[i] = std::min(1.F, said[i].weight / kWhole) * (1 - 4 * variance);
  }
  return data;
}

/// Cells of one level, a byte each: around what the next finer level must have.
class Marks {
 public:
  explicit Marks(int cells)
      : cells_(cells),
        marked_(static_cast<std::size_t>(cells) * static_cast<std::size_t>(cells) *
                static_cast<std::size_t>(cells)) {}
  void add(const Lattice::Node& cell, int around) {
    const auto low = [&](int c) { return std::clamp(c - around, 0, cells_ - 1); };
    const auto high = [&](int c) { return std::clamp(c + around, 0, cells_ - 1); };
    for (int x = low(cell[0]); x <= high(cell[0]); ++x)
      for (int y = low(cell[1]); y <= high(cell[1]); ++y)
        for (int z = low(cell[2]); z <= high(cell[2]); ++z)
          marked_[static_cast<std::size_t>((x * cells_ + y)) * static_cast<std::size_t>(cells_) +
                  static_cast<std::size_t>(z)] = 1;
  }
  void add(const std::vector<Patch>& patches) {
    for (const Patch& p : patches) {
      Lattice::Node cell{};
      for (std::size_t axis = 0; axis < 3; ++axis)
        cell[axis] = static_cast<int>(std::floor(p.position[static_cast<Eigen::Index>(axis)]));
      // A finer sample reaches kReach of its cells, half as many of these.
      const double reach = std::max(0.5 * kReach, kSpacingReach * p.spacing);
      add(cell, static_cast<int>(std::ceil(reach)));
    }
  }
  /// The cells in which the field changes its sign, and those beside them.
  void add_surface(const Lattice& lattice, const std::vector<float>& values) {
    std::array<int, 8> corners{};
    for (std::size_t i = 0; i < lattice.size(); ++i) {
      if (!lattice.corners(i, corners)) continue;
      const bool inside = values[i] > 0;
      const bool changes = std::any_of(corners.begin(), corners.end(), [&](int k) {
        return (values[static_cast<std::size_t>(k)] > 0) != inside;
      });
      if (changes) add(lattice.node(i), 1);
    }
  }
  /// Those that the lattice does not have go: it has nothing to say of them.
  void keep_cells_of(const Lattice& lattice) {
    std::vector<std::uint8_t> there(marked_.size(), 0);
    std::array<int, 8> corners{};
    for (std::size_t i = 0; i < lattice.size(); ++i) {
      if (!lattice.corners(i, corners)) continue;
      const Lattice::Node n = lattice.node(i);
      there[static_cast<std::size_t>(n[0] * cells_ + n[1]) * static_cast<std::size_t>(cells_) +
            static_cast<std::size_t>(n[2])] = 1;
    }
    for (std::size_t k = 0; k < marked_.size(); ++k) marked_[k] &= there[k];
  }
  [[nodiscard]] const std::vector<std::uint8_t>& bytes() const { return marked_; }

 private:
  int cells_;
  std::vector<std::uint8_t> marked_;
};

/// Values of a lattice of half the cells, between its nodes.
std::vector<float> prolonged(const Lattice& coarse, const std::vector<float>& values,
                             const Lattice& fine) {
  std::vector<float> result(fine.size());
  const auto between = [&](std::size_t i) {
    const Lattice::Node n = fine.node(i);
    float sum = 0;
    int count = 0;
    for (int x = n[0] / 2; x <= (n[0] + 1) / 2; ++x) {
      for (int y = n[1] / 2; y <= (n[1] + 1) / 2; ++y) {
        for (int z = n[2] / 2; z <= (n[2] + 1) / 2; ++z) {
          const int k = coarse.find(x, y, z);
          PENCILSCAN_CHECK(k != Lattice::kNone);
          sum += values[static_cast<std::size_t>(k)];
          ++count;
        }
      }
    }
    return sum / static_cast<float>(count);
  };
  parallel_chunks(fine.size(), [&](std::size_t i) { result[i] = between(i); });
  return result;
}

/// The field without what is below the floor: the distance to that, as a sample's, where it is
/// less.
std::vector<float> above_floor(const Floor& floor, const Vec3& origin, double cell,
                               const Lattice& lattice, std::vector<float> values) {
  parallel_chunks(lattice.size(), [&](std::size_t i) {
    const Lattice::Node n = lattice.node(i);
    const double height = floor.height(origin + cell * Vec3(n[0], n[1], n[2])) / cell;
    values[i] = std::min(values[i], static_cast<float>(std::clamp(height / kStep, -0.5, 0.5)));
  });
  return values;
}

Lattice whole_cube() {
  constexpr std::size_t kCells = kCoarsest;
  return {kCoarsest, 1, std::vector<std::uint8_t>(kCells * kCells * kCells, 1)};
}

}  // namespace

InsideField inside_field(std::span<const SurfaceSample> samples, const Vec3& origin, double cell,
                         int cells, const std::optional<Floor>& floor) {
  PENCILSCAN_CHECK(cells >= kCoarsest && cells <= Lattice::kMaxCells && cell > 0);
  std::vector<std::vector<Patch>> levels{merged(patches_of(samples, origin, cell), cells)};
  for (int n = cells / 2; n >= kCoarsest; n /= 2) levels.push_back(coarser(levels.back(), n));
  PENCILSCAN_CHECK(cells == kCoarsest << (levels.size() - 1));

  InsideField field{whole_cube(), {}, origin, cell};
  field.values.assign(field.lattice.size(), -0.5F);
  solve_field(field.lattice, data_of(levels.back(), field.lattice), kCoarsestTolerance,
              field.values);
  // Each level is solved as if there were no floor: the object's sides go on to it.
  const auto without_floor = [&] {
    const double side = cell * cells / field.lattice.cells();
    return floor ? above_floor(*floor, origin, side, field.lattice, field.values) : field.values;
  };
  for (std::size_t level = levels.size() - 1; level-- > 0;) {
    Marks marks(field.lattice.cells());
    marks.add(levels[level + 1]);
    marks.add_surface(field.lattice, without_floor());
    marks.keep_cells_of(field.lattice);
    Lattice fine(2 * field.lattice.cells(), 2, marks.bytes());
    std::vector<float> values = prolonged(field.lattice, field.values, fine);
    solve_field(fine, data_of(levels[level], fine), kTolerance, values);
    field.lattice = std::move(fine);
    field.values = std::move(values);
  }
  field.values = without_floor();
  return field;
}

}  // namespace pencilscan
