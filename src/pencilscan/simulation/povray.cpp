#include "pencilscan/simulation/povray.h"

#include <iomanip>
#include <map>
#include <ostream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/simulation/other_renderer.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// Distance of the slits from the projector's centre, of that of the devices: no object comes that
/// near.
constexpr double kSlitShare = 0.01;
/// Segments along a slit of a projector with lens distortion.
constexpr int kBentSegments = 64;

struct Vector {  // prints as <x, y, z>
  Vec3 v;
};
std::ostream& operator<<(std::ostream& out, const Vector& vector) {
  return out << '<' << vector.v.x() << ", " << vector.v.y() << ", " << vector.v.z() << '>';
}

template <typename Items, typename Print>
void write_list(std::ostream& out, const char* name, const Items& items, const Print& print) {
  out << "  " << name << " { " << items.size();
  for (const auto& item : items) {
    out << ",\n    ";
    print(item);
  }
  out << " }\n";
}

void write_object(std::ostream& out, const SimulatedObject& object, double ambient) {
  const Reflectance& surface = object.surface();
  out << std::setprecision(9) << "mesh2 {\n";
  const auto print_vector = [&](const Vec3& v) { out << Vector{v}; };
  write_list(out, "vertex_vectors", object.mesh().vertices, print_vector);
  if (surface.smooth) write_list(out, "normal_vectors", object.normals(), print_vector);
  write_list(out, "face_indices", object.mesh().faces, [&](const std::array<int, 3>& f) {
    out << '<' << f[0] << ", " << f[1] << ", " << f[2] << '>';
  });
  // Brightness b of the texture gives the albedo factor 1 - contrast * (1 - b).
  const double dark = 1 - surface.texture.contrast;
  const RigidTransform& pose = object.world_from_object();
  out << "  texture {\n    pigment { ";
  if (surface.texture.kind == TextureKind::kStripes) {
    out << "function { 0.5 + 0.5 * sin(2 * pi * x / " << surface.texture.period_mm
        << ") } color_map { [0 rgb " << dark << "] [1 rgb 1] }";
  } else if (surface.texture.kind == TextureKind::kChecker) {
    out << "checker rgb 1, rgb " << dark << " scale " << 0.5 * surface.texture.period_mm;
  } else {
    out << "rgb 1";
  }
  out << " }\n    finish { ambient " << ambient * surface.albedo << " diffuse " << surface.albedo
      << " specular " << surface.specular << " roughness " << surface.roughness
      << " }\n    matrix <";
  for (Eigen::Index column = 0; column < 3; ++column) {  // POV-Ray multiplies rows from the left
    for (Eigen::Index row = 0; row < 3; ++row) out << pose.rotation(row, column) << ", ";
  }
  out << pose.translation.x() << ", " << pose.translation.y() << ", " << pose.translation.z()
      << ">\n  }\n}\n";
}

/// The slits of all lines of one colour, as a mesh in front of the projector.
void write_slits(std::ostream& out, const Projector& projector, const LinePattern& pattern,
                 const PatternColor& color, double slit_distance) {
  const RigidTransform world_from_device = projector.device_from_world.inverse();
  const bool columns = pattern.axis == Axis::kColumn;
  const double across_end = projector.size_across(pattern) - 0.5;
  const double along_end = (columns ? projector.height : projector.width) - 0.5;
  const int segments = projector.has_distortion() ? kBentSegments : 1;
  const auto corner = [&](double across, double along) {
    const Vec2 pixel = columns ? Vec2(across, along) : Vec2(along, across);
    return Vector{world_from_device *
                  (slit_distance * projector.normalized_from_pixel(pixel).homogeneous())};
  };
  out << "mesh {\n";
  for (int line = 0; line < projector.line_count(pattern); ++line) {
    if (pattern.colors[static_cast<std::size_t>(pattern.symbol(line))] != color) continue;
    const double center = pattern.position_px(line);
    const double low = std::max(-0.5, center - 0.5 * pattern.line_width_px);
    const double high = std::min(across_end, center + 0.5 * pattern.line_width_px);
    for (int s = 0; s < segments; ++s) {
      const double from = -0.5 + (along_end + 0.5) * s / segments;
      const double to = -0.5 + (along_end + 0.5) * (s + 1) / segments;
      const Vector a = corner(low, from);
      const Vector c = corner(high, to);
      out << "  triangle { " << a << ", " << corner(high, from) << ", " << c << " }\n"
          << "  triangle { " << a << ", " << c << ", " << corner(low, to) << " }\n";
    }
  }
  out << "}\n";
}

void write_lights(std::ostream& out, const Rig& rig, const RenderOptions& options) {
  const double reference = reference_distance(rig);
  constexpr double kFade = 100;  // see the header
  out << std::setprecision(15);
  for (const Projector& projector : rig.projectors) {
    const Vec3 center = projector.center();
    const double strength =
        options.exposure * (options.inverse_square ? 0.5 * (1 + kFade * kFade) : 1);
    for (const LinePattern& pattern : projector.patterns) {
      std::map<PatternColor, bool> used;
      for (const int symbol : pattern.sequence) {
        used[pattern.colors[static_cast<std::size_t>(symbol)]] = true;
      }
      for (const auto& [color, is_used] : used) {
        const Rgb& rgb = color.light();
        out << "// " << projector.name << ": " << color.text() << "\nlight_source {\n  "
            << Vector{center} << " rgb " << strength << " * <" << rgb[0] << ", " << rgb[1] << ", "
            << rgb[2] << ">\n";
        if (options.inverse_square) {
          out << "  fade_distance " << reference / kFade << " fade_power 2\n";
        }
        out << "  projected_through { ";
        write_slits(out, projector, pattern, color, kSlitShare * reference);
        out << " }\n}\n";
      }
    }
  }
}

void write_camera(std::ostream& out, const Camera& camera) {
  // POV-Ray's ray through pixel (u, v): direction + ((u + 0.5) / width - 0.5) right
  //                                              + (0.5 - (v + 0.5) / height) up.
  const Mat3 axes = camera.device_from_world.rotation.transpose();  // columns: device axes in world
  const double fx = camera.K(0, 0);
  const double fy = camera.K(1, 1);
  const Vec2 middle =
      camera.normalized_from_pixel({0.5 * (camera.width - 1), 0.5 * (camera.height - 1)});
  const Vec3 right = axes.col(0) * (camera.width / fx);
  // With skew a step down in the image also moves in x.
  const Vec3 down = axes * Vec3(-camera.K(0, 1) / (fx * fy), 1 / fy, 0) * camera.height;
  out << std::setprecision(15) << "#version 3.7;\nglobal_settings { assumed_gamma 1.0 }\n"
      << "background { rgb 0 }\n#include \"mesh.inc\"\n#include \"rig.inc\"\ncamera {\n  "
         "perspective"
      << "\n  location " << Vector{camera.center()} << "\n  direction "
      << Vector{axes * middle.homogeneous()} << "\n  right " << Vector{right} << "\n  up "
      << Vector{-down} << "\n}\n";
}

}  // namespace

void check_povray_can_show(const Rig& rig, const Reflectance& surface, const fs::path& rig_path) {
  check_other_renderer_can_show(rig, rig_path, "--export-povray", "POV-Ray 3.7");
  if (surface.texture.kind == TextureKind::kNoise) {
    throw InputError("--texture", "", "noise", "cannot be exported to POV-Ray; use another one");
  }
}

void write_povray_scene(const fs::path& folder, const Rig& rig, const SimulatedObject& object,
                        const RenderOptions& options) {
  write_atomically(folder / "mesh.inc",
                   [&](std::ostream& out) { write_object(out, object, options.ambient); });
  write_atomically(folder / "rig.inc", [&](std::ostream& out) { write_lights(out, rig, options); });
  for (const Camera& camera : rig.cameras) {
    write_atomically(folder / (camera.name + ".pov"),
                     [&](std::ostream& out) { write_camera(out, camera); });
    write_atomically(folder / (camera.name + ".ini"), [&](std::ostream& out) {
      out << "Input_File_Name=" << camera.name << ".pov\nOutput_File_Name=" << camera.name
          << ".png\nWidth=" << camera.width << "\nHeight=" << camera.height
          << "\nDisplay=Off\nOutput_File_Type=N\nBits_Per_Color=16\nFile_Gamma=1.0\n"
          << "Antialias=On\nSampling_Method=1\nAntialias_Threshold=0.0\nAntialias_Depth="
          << std::max(2, options.samples) << "\nAntialias_Gamma=1.0\nJitter=Off\n";
    });
  }
}

}  // namespace pencilscan
