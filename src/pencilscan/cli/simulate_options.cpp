#include "pencilscan/cli/simulate_options.h"

#include <map>

#include "pencilscan/cli/arguments.h"

namespace pencilscan::cli {
namespace {

/// For what shapes the light that we render: there is none of it in a scene of --light alone.
CLI::Validator only_of_own_light(const SimulateOptions& options) {
  return only_where(
      [&options] {
        return options.light.empty() || options.gray_code || options.export_povray ||
               options.export_blender;
      },
      "does not go with --light: light is as it was made");
}

}  // namespace

void add_scene_options(CLI::App& command, SimulateOptions& options) {
  const std::map<std::string, UpAxis> axes{{"x", UpAxis::kX}, {"y", UpAxis::kY}, {"z", UpAxis::kZ}};
  const std::map<std::string, TextureKind> textures{{"none", TextureKind::kNone},
                                                    {"noise", TextureKind::kNoise},
                                                    {"stripes", TextureKind::kStripes},
                                                    {"checker", TextureKind::kChecker}};
  command.add_flag("--fit", options.fit, "Centre and scale the mesh into the rig's volume");
  command
      .add_option("--scale", options.scale,
                  "Multiply the mesh: 1000 for one in metres, 25.4 for one in inches")
      ->check(above_zero())
      ->check(told_where_not(
          "--scale", [&options] { return !options.fit; },
          "does not change what --fit makes of the mesh"))
      ->capture_default_str();
  command.add_option("--up", options.up, "Axis of the mesh that points up")
      ->transform(choice(axes))
      ->default_str("z");
  add_number(command, "--frame-count", options.frame_count, 1, 999999, "Frames of a moving object");
  const auto moves = [&options](const char* option) {
    return told_where_not(
        option, [&options] { return options.frame_count > 1; }, "needs --frame-count 2 or more");
  };
  command.add_option("--rotate-deg", options.rotate_deg, "Turn about the vertical per frame")
      ->check(any_number<double>())
      ->check(moves("--rotate-deg"));
  command.add_option("--translate-mm", options.translate_mm, "Shift x y z per frame")
      ->expected(3)
      ->check(any_number<double>())
      ->check(moves("--translate-mm"));
  CLI::Option* motion =
      command
          .add_option("--motion-mm-s", options.speed_mm_s,
                      "Speed x y z (in the rig's unit) within the exposure of every frame, whose "
                      "truth is its middle; Gray-code captures stand still")
          ->expected(3)
          ->check(any_number<double>());
  CLI::Option* spin = command
                          .add_option("--spin-deg-s", options.spin_deg_s,
                                      "Turning speed about x y z through the volume's centre, "
                                      "likewise")
                          ->expected(3)
                          ->check(any_number<double>());
  command
      .add_option("--exposure-ms", options.exposure_ms,
                  "Of a frame, for --motion-mm-s and --spin-deg-s")
      ->check(above_zero())
      ->check(told_where_not(
          "--exposure-ms", [motion, spin] { return motion->count() + spin->count() > 0; },
          "needs --motion-mm-s or --spin-deg-s"))
      ->capture_default_str();
  const CLI::Validator renders = only_of_own_light(options);
  const auto textured = [&options](const char* option) {
    return told_where_not(
        option, [&options] { return options.surface.texture.kind != TextureKind::kNone; },
        "needs --texture checker, noise or stripes");
  };
  add_number(command, "--albedo", options.surface.albedo, 0, 1,
             "Share of the light that the surface gives back")
      ->check(renders);
  command.add_option("--texture", options.surface.texture.kind, "What varies the albedo")
      ->transform(choice(textures))
      ->check(renders)
      ->default_str("none");
  add_number(command, "--contrast", options.surface.texture.contrast, 0, 1,
             "Contrast of the texture")
      ->check(textured("--contrast"));
  command
      .add_option("--texture-mm", options.surface.texture.period_mm, "Period of the texture, mm")
      ->check(above_zero())
      ->check(textured("--texture-mm"))
      ->capture_default_str();
  command.add_option("--specular", options.surface.specular, "Weight of the Blinn-Phong lobe")
      ->check(zero_or_more())
      ->check(renders)
      ->capture_default_str();
  add_number(command, "--roughness", options.surface.roughness, 1e-4, 1,
             "1 / exponent of that lobe")
      ->check(told_where_not(
          "--roughness", [&options] { return options.surface.specular > 0; },
          "needs --specular above 0"));
  command.add_flag("--flat", options.flat, "One normal per face (cubes); else smooth shading");
}

void add_device_options(CLI::App& command, SimulateOptions& options) {
  const CLI::Validator renders = only_of_own_light(options);
  add_number(command, "--samples", options.photo.render.samples, 1, 16, "Rays per pixel and axis")
      ->check(renders);
  command
      .add_option("--exposure", options.photo.render.exposure,
                  "Image value of a white surface that faces a projector at the centre")
      ->check(above_zero())
      ->check(renders)
      ->capture_default_str();
  command.add_flag("--no-falloff", options.no_falloff, "Light does not weaken with distance")
      ->check(renders);
  command
      .add_flag("--pixelated", options.photo.film.pixelated, "Projector pixels, no continuous film")
      ->check(renders);
  command
      .add_option("--projector-blur", options.photo.film.blur_px, "Standard deviation, panel px")
      ->check(between(0.0, 50.0))
      ->check(renders);
  command
      .add_option("--black-level", options.photo.black_level,
                  "Light of a black panel pixel (default 0; 0.004 in captures)")
      ->check(between(0.0, 0.9))
      ->check(renders);
  command
      .add_option("--noise", options.photo.noise,
                  "Sensor preset: crosstalk, ambient light, blur and noise together")
      ->check(one_of({"none", "low", "medium", "high"}))
      ->capture_default_str();
  command.add_option("--crosstalk", options.photo.crosstalk, "Share that colour filters leak")
      ->check(between(0.0, 0.5));
  command
      .add_option("--ambient", options.photo.ambient,
                  "Even light on all surfaces, image value of a white one")
      ->check(between(0.0, 1.0))
      ->check(renders);
  command.add_option("--blur", options.photo.blur_px, "Camera blur, standard deviation, px")
      ->check(between(0.0, 50.0));
  command
      .add_option("--full-well", options.photo.full_well, "Electrons at value 1; 0: no shot noise")
      ->check(zero_or_more());
  command
      .add_option("--read-noise", options.photo.read_noise,
                  "Standard deviation, 1/255 of the range")
      ->check(zero_or_more());
  command.add_option("--gain", options.photo.gain, "Of the sensor, after its noise")
      ->check(above_zero())
      ->capture_default_str();
  command.add_option("--bits", options.photo.bits, "Of the images, per channel")
      ->check(one_of({"8", "16"}))
      ->capture_default_str();
  command
      .add_option("--interpolated", options.interpolated,
                  "Colours as a camera fills them in behind this mosaic, where the rig states none")
      ->check(one_of({"RGGB", "BGGR", "GRBG", "GBRG"}));
  command.add_option("--jpeg", options.jpeg, "Frames as JPEG of this quality; 8 bits")
      ->check(between(1, 100))
      ->check(only_where([&options] { return options.photo.bits == 8; }, "needs --bits 8"));
}

}  // namespace pencilscan::cli
