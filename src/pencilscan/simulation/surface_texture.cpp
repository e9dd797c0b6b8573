#include "pencilscan/simulation/surface_texture.h"

#include <cmath>
#include <cstdint>

namespace pencilscan {
namespace {

/// Hash of a lattice point to [0, 1): the finaliser of MurmurHash3 (Appleby, public domain).
double lattice_value(std::int64_t x, std::int64_t y, std::int64_t z) {
  std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^
                    static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^
                    static_cast<std::uint64_t>(z) * 0x165667B19E3779F9ULL;
  h ^= h >> 33U;
  h *= 0xFF51AFD7ED558CCDULL;
  h ^= h >> 33U;
  h *= 0xC4CEB9FE1A85EC53ULL;
  h ^= h >> 33U;
  return static_cast<double>(h >> 11U) / 9007199254740992.0;
}

/// Value noise: lattice values blended with a cubic smooth step.
double value_noise(const Vec3& p) {
  const Vec3 cell = p.array().floor();
  const Vec3 t = p - cell;
  const Vec3 s = t.array().square() * (3 - 2 * t.array());
  const auto x = static_cast<std::int64_t>(cell.x());
  const auto y = static_cast<std::int64_t>(cell.y());
  const auto z = static_cast<std::int64_t>(cell.z());
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1;
    const int j = (corner >> 1) & 1;
    const int k = corner >> 2;
    sum += (i != 0 ? s.x() : 1 - s.x()) * (j != 0 ? s.y() : 1 - s.y()) *
           (k != 0 ? s.z() : 1 - s.z()) * lattice_value(x + i, y + j, z + k);
  }
  return sum;
}

}  // namespace

double SurfaceTexture::factor(const Vec3& x_in_object) const {
  const Vec3 p = x_in_object / period_mm;
  double brightness = 1;
  switch (kind) {
    case TextureKind::kNone:
      return 1;
    case TextureKind::kNoise:
      // Three octaves, the finest a quarter of the period; weights add up to one.
      brightness = (4 * value_noise(p) + 2 * value_noise(2 * p) + value_noise(4 * p)) / 7;
      break;
    case TextureKind::kStripes:
      brightness = 0.5 + 0.5 * std::sin(2 * M_PI * p.x());
      break;
    case TextureKind::kChecker: {
      const Vec3 cell = (2 * p).array().floor();
      brightness = std::fmod(std::abs(cell.sum()), 2.0) < 0.5 ? 1 : 0;
      break;
    }
  }
  return 1 - contrast * (1 - brightness);
}

}  // namespace pencilscan
