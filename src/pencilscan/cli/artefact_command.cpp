#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "pencilscan/artefact/artefact.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/file.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

enum class Artefact { kSphere, kBallBar, kPlate };

struct ArtefactCommand {
  CommonOptions common;
  Artefact artefact = Artefact::kSphere;
  std::vector<std::string> files;
  std::string surface = "points";
  std::string rig_path;
  std::string report_path;
  bool overwrite = false;
  std::vector<double> region;  ///< x y z radius
  std::vector<double> stem;    ///< x y z degrees
  ArtefactOptions options;
};

/// The rig that --rig names, or that stands beside a result of ours: it says where the cameras are.
std::optional<Rig> rig_of(const ArtefactCommand& command, const fs::path& file) {
  if (!command.rig_path.empty()) return read_rig(command.rig_path);
  for (const fs::path& folder : {file.parent_path(), file.parent_path().parent_path()}) {
    if (fs::exists(folder / "devices.json")) return read_rig(folder / "devices.json");
  }
  return std::nullopt;
}

void tell_warnings(const fs::path& file, const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) warn_of(file.string() + ": " + warning);
}

void measure(const ArtefactCommand& command, const fs::path& file, ArtefactTest& test) {
  const ArtefactPoints points = read_artefact_points(file);
  const std::optional<Rig> rig = rig_of(command, file);
  const Rig* known = rig ? &*rig : nullptr;
  switch (command.artefact) {
    case Artefact::kSphere:
      test.spheres.push_back(measure_sphere(points, known, test.options));
      tell_warnings(file, artefact_warnings(test.spheres.back(), test.options));
      break;
    case Artefact::kBallBar:
      test.ball_bars.push_back(measure_ball_bar(points, known, test.options));
      tell_warnings(file, artefact_warnings(test.ball_bars.back(), test.options));
      break;
    case Artefact::kPlate:
      test.plates.push_back(measure_plate(points, known, test.options));
      tell_warnings(file, artefact_warnings(test.plates.back(), test.options));
      break;
  }
}

void print_ball(const BallFigures& ball) {
  std::printf("%9.6g %9.4f %9.4f ", 2 * ball.sphere.radius, ball.form_mm.all, ball.form_mm.trimmed);
  if (ball.size_mm) {
    std::printf("%+9.4f %+9.4f ", ball.size_mm->all, ball.size_mm->trimmed);
  } else {
    std::printf("%9s %9s ", "", "");
  }
  std::printf("%7.1f %% %9zu %8zu", 100 * ball.coverage, ball.points.points.size(), ball.left_out);
}

constexpr const char* kBallHead =
    " diameter        PF   PF trim        PS   PS trim  coverage    points left out";

void print_table(const ArtefactTest& test) {
  if (!test.plates.empty()) {
    std::printf("              sides         F    F trim  coverage    points left out  position\n");
    for (const PlateFigures& plate : test.plates) {
      std::printf("%8.5g x %8.5g %9.4f %9.4f %7.1f %% %9zu %8zu  %s\n", plate.surface.length_mm,
                  plate.surface.width_mm, plate.flatness_mm.all, plate.flatness_mm.trimmed,
                  100 * plate.coverage, plate.points.points.size(), plate.left_out,
                  plate.points.source.c_str());
    }
    return;
  }
  if (!test.spheres.empty()) {
    std::printf("%s  position\n", kBallHead);
    for (const BallFigures& ball : test.spheres) {
      print_ball(ball);
      std::printf("  %s\n", ball.points.source.c_str());
    }
    return;
  }
  std::printf(" distance        SD   SD trim  ball %s  position\n", kBallHead);
  for (const BallBarFigures& bar : test.ball_bars) {
    for (std::size_t b = 0; b < bar.balls.size(); ++b) {
      if (b == 0) {
        std::printf("%9.6g ", bar.distance_mm.all);
      } else {
        std::printf("%9s ", "");
      }
      if (b == 0 && bar.spacing_mm) {
        std::printf("%+9.4f %+9.4f ", bar.spacing_mm->all, bar.spacing_mm->trimmed);
      } else {
        std::printf("%9s %9s ", "", "");
      }
      std::printf("%5zu ", b + 1);
      print_ball(bar.balls[b]);
      std::printf("  %s\n", b == 0 ? bar.balls[b].points.source.c_str() : "");
    }
  }
}

void print_worst(const nlohmann::ordered_json& worst) {
  std::printf("\nworst:");
  for (const auto& [key, value] : worst.items()) {
    if (key.ends_with("_mm")) {
      std::string name = key.substr(0, key.size() - 3);
      const auto trimmed = name.find("_trimmed");
      if (trimmed != std::string::npos) name.replace(trimmed, 8, " trim");
      std::printf(" %s %.4f mm,", name.c_str(), value.get<double>());
    }
  }
  std::printf(" least coverage %.1f %%, fewest points %zu\n", 100 * worst["coverage"].get<double>(),
              worst["points"].get<std::size_t>());
}

void print_lacking(const std::vector<LackingPosition>& lacking) {
  if (lacking.empty()) return;
  std::printf("\nwithout a result, and in none of these figures:\n");
  for (const LackingPosition& position : lacking)
    std::printf("  %s: %s\n", position.folder.c_str(), position.why.c_str());
}

/// A position that cannot be measured has no result. StageError where not one has.
void measure_all(const ArtefactCommand& command, const std::vector<fs::path>& files,
                 ArtefactTest& test) {
  std::size_t measured = 0;
  for (const fs::path& file : files) {
    try {
      measure(command, file, test);
      ++measured;
    } catch (const StageError& error) {
      std::string why = error.what();
      const std::string source = file.string() + ": ";
      if (why.starts_with(source)) why.erase(0, source.size());
      test.lacking.push_back({file, why});
    }
  }
  if (measured == 0)
    throw StageError("no position has a result; " + test.lacking.front().folder.string() + ": " +
                     test.lacking.front().why);
  for (const LackingPosition& position : test.lacking)
    warn_of(position.folder.string() + " has no result: " + position.why);
}

constexpr const char* kLegend = R"(
All in mm, after the manner of VDI/VDE 2634 part 3 and ISO 10360-13.
  PF        form: greatest minus least distance of the points to their least-squares sphere
  PS        size: diameter of that sphere minus --diameter
  SD        distance of the centres of spheres of --diameter, minus --length
  diameter  of that sphere, distance of those centres, and sides of the plate's surface: as they
            were measured, by which points in another unit are noticed
  F         flatness: greatest minus least distance of the points to their least-squares plane
  trim      with the worst 3 per mille of the points removed; elsewhere nothing is removed
  coverage  share of the artefact's surface within 1 % of its diameter (diagonal) of a point
)";

void run_artefact(ArtefactCommand command) {
  const ThreadLimit threads(command.common.threads);
  ArtefactTest test;
  test.options = command.options;
  test.options.seed = command.common.seed;
  if (command.region.size() == 4) {
    const auto& r = command.region;
    if (!(r[3] > 0)) throw InputError("--region", "radius", std::to_string(r[3]), "must be > 0");
    test.options.region = Sphere{{r[0], r[1], r[2]}, r[3]};
  }
  if (command.stem.size() == 4) {
    const Vec3 direction(command.stem[0], command.stem[1], command.stem[2]);
    if (!(direction.norm() > 0) || !(command.stem[3] > 0 && command.stem[3] < 180)) {
      throw InputError("--stem", "", "",
                       "must be a direction x y z and half the cone's angle, above 0 and below "
                       "180 degrees");
    }
    test.options.stem = {direction.normalized(), command.stem[3] * std::numbers::pi / 180};
  }
  if (!command.report_path.empty())
    refuse_existing("--report", command.report_path, command.overwrite);
  const FrameSurface surface =
      command.surface == "mesh" ? FrameSurface::kMesh : FrameSurface::kPoints;
  std::vector<fs::path> files;
  for (const std::string& argument : command.files) {
    const ArtefactFiles found = artefact_files(argument, surface);
    files.insert(files.end(), found.files.begin(), found.files.end());
    test.lacking.insert(test.lacking.end(), found.lacking.begin(), found.lacking.end());
  }
  const std::size_t positions = files.size() + test.lacking.size();
  measure_all(command, files, test);
  const nlohmann::ordered_json json = artefact_json(test);
  print_table(test);
  print_worst(json["worst"]);
  print_lacking(test.lacking);
  std::printf("%s", kLegend);
  std::fflush(stdout);
  write_figures(command.common, json);
  if (!command.report_path.empty())
    write_text(command.report_path, artefact_html(test, "pencilscan " PENCILSCAN_VERSION));
  if (!test.lacking.empty()) {
    throw StageError(std::to_string(test.lacking.size()) + " of " + std::to_string(positions) +
                     " positions have no result: the figures are those of the others");
  }
}

CLI::Option* add_positive(CLI::App& command, const char* flag, std::optional<double>& value,
                          const char* text) {
  return command.add_option(flag, value, text)->check(above_zero());
}

/// What was calibrated of the artefact, and what else is in the picture.
void add_size_options(CLI::App& command, ArtefactCommand& options) {
  ArtefactOptions& sizes = options.options;
  if (options.artefact != Artefact::kPlate) {
    CLI::Option* diameter =
        command
            .add_option("--diameter", sizes.diameter_mm, "Calibrated diameter of the ball(s), mm")
            ->check(above_zero());
    if (options.artefact == Artefact::kBallBar) diameter->required();
  }
  if (options.artefact == Artefact::kSphere) {
    command
        .add_option("--stem", options.stem,
                    "Leaves a stem or stand out: x y z of its direction from the ball's centre, "
                    "and half the angle of the cone around it in degrees, as 0 0 -1 30")
        ->expected(4)
        ->check(any_number<double>());
  }
  if (options.artefact == Artefact::kBallBar) {
    add_positive(command, "--length", sizes.length_mm,
                 "Calibrated distance of the balls' centres, mm");
    command
        .add_option("--bar-diameter", sizes.bar_diameter_mm,
                    "Of the bar between the balls, mm: points around it are left out")
        ->check(above_zero());
  }
  if (options.artefact == Artefact::kPlate) {
    CLI::Option* length = add_positive(command, "--length", sizes.plate_length_mm,
                                       "Of the plate, mm: with --width for the coverage");
    CLI::Option* width = add_positive(command, "--width", sizes.plate_width_mm,
                                      "Of the plate, mm: with --length for the coverage");
    length->check(told_where_not(
        "--length", [width] { return width->count() > 0; }, "needs --width"));
    width->check(told_where_not(
        "--width", [length] { return length->count() > 0; }, "needs --length"));
    CLI::Option* thickness =
        add_positive(command, "--thickness", sizes.plate_thickness_mm,
                     "Of the plate, mm, where more than one face was measured: takes the face that "
                     "has most points");
    command
        .add_option("--border", sizes.border_mm,
                    "Points closer than this to the rim are left out, mm")
        ->check(zero_or_more())
        ->capture_default_str()
        ->needs(thickness);
  }
}

std::shared_ptr<ArtefactCommand> add_artefact(CLI::App& group, Artefact artefact, const char* name,
                                              const char* text, const char* example) {
  auto options = std::make_shared<ArtefactCommand>();
  options->artefact = artefact;
  CLI::App* command = group.add_subcommand(name, text);
  command
      ->add_option("files", options->files,
                   "One position each: a PLY file of points or a mesh, from any program, or a "
                   "frame's results; an output folder is a position per frame")
      ->required();
  add_size_options(*command, *options);
  command
      ->add_option("--region", options->region,
                   "x y z radius, mm: only what lies in this sphere is the artefact")
      ->expected(4)
      ->check(any_number<double>());
  command
      ->add_option("--surface", options->surface,
                   "Of a result folder: points (points.ply) or mesh (mesh_measured.ply)")
      ->check(one_of({"points", "mesh"}))
      ->check(told_where_not(
          "--surface",
          [options] {
            return std::any_of(options->files.begin(), options->files.end(),
                               [](const std::string& file) { return fs::is_directory(file); });
          },
          "needs a result folder"))
      ->capture_default_str();
  command->add_option("--rig", options->rig_path,
                      "Where the cameras are, for errors against their sigma; default: the "
                      "devices.json of a result folder");
  CLI::Option* report =
      command->add_option("--report", options->report_path, "Also write this HTML page");
  add_overwrite(*command, options->overwrite, "Replace a report that is there", report);
  add_common_options(*command, options->common, example);
  command->callback([options] { run_artefact(*options); });
  return options;
}

}  // namespace

void add_artefact_command(CLI::App& app) {
  CLI::App* group = app.add_subcommand(
      "artefact", "Acceptance figures from a ball, a ball bar or a plate of known size");
  group->require_subcommand(1);
  group->footer(
      "Example:\n  pencilscan artefact sphere --diameter 50.004 --report ball.html result");
  add_artefact(*group, Artefact::kSphere, "sphere", "A ball: probing errors of form and size",
               "pencilscan artefact sphere --diameter 50.004 --report ball.html result");
  add_artefact(*group, Artefact::kBallBar, "ballbar", "Two balls a known distance apart",
               "pencilscan artefact ballbar --diameter 30.001 --length 250.013 a.ply b.ply c.ply");
  add_artefact(*group, Artefact::kPlate, "plate", "A plate: flatness",
               "pencilscan artefact plate --length 300 --width 200 plate.ply");
}

}  // namespace pencilscan::cli
