#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace pencilscan {

struct PlyElement;

/// What became of a curve point.
enum class CurveState : std::uint8_t {
  kLabelled,
  kNoCrossing,
  kAmbiguous,
  kContradicted,
  kOutsideVolume,
  kUndecided,  ///< without a recorded reason
};

/// One sub-pixel point of a detected curve: a vertex of curves.ply (docs/formats.md). Points of one
/// curve follow each other.
struct CurveSample {
  /// For viewers, world, mm: the pixel on a picture of the camera that stands before the object.
  float x = 0, y = 0, z = 0;
  float u = 0, v = 0;       ///< camera pixel
  float sigma_px = 0;       ///< one standard deviation across the curve
  float amplitude = 0;      ///< height of the line above its surroundings
  std::uint8_t camera = 0;  ///< index in the rig
  std::uint32_t curve = 0;  ///< index within the camera
  std::uint8_t family = 0;  ///< which set of colours
  std::uint8_t color = 0;   ///< likeliest colour within the family
  float color_lead = 0;     ///< its log-likelihood minus that of the next one, >= 0
  CurveState state = CurveState::kUndecided;
  std::uint8_t projector = 0;  ///< of the label; 0 where there is none, as the next three
  std::uint8_t pattern = 0;
  std::uint16_t line = 0;
  float confidence = 0;  ///< of the label, 0..1
  /// For viewers (sRGB): the colour of the line that the label names, grey where there is none.
  std::uint8_t red = 0, green = 0, blue = 0;
};

/// Where two curves of a camera cross.
struct CurveCrossing {
  float u = 0, v = 0;
  std::uint8_t camera = 0;
  std::uint32_t curve_a = 0;
  std::uint32_t curve_b = 0;
};

struct CurveFile {
  std::vector<CurveSample> samples;
  std::vector<CurveCrossing> crossings;
};

/// Writes curves.ply, binary little endian: elements `vertex`, `edge` (neighbours on a curve, which
/// viewers draw as lines) and `crossing`. Whole or not at all.
void write_curves(const std::filesystem::path& path, const CurveFile& curves);
/// For readers of points: InputError where these are the vertices of curves.ply, which lie where
/// a viewer shows pictures.
void refuse_curves(const std::filesystem::path& path, const PlyElement& vertices);
/// Reads what write_curves() wrote, but for what is for viewers; InputError when a property is
/// missing or out of range.
[[nodiscard]] CurveFile read_curves(const std::filesystem::path& path);

}  // namespace pencilscan
