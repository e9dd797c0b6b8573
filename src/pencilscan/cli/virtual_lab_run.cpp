#include "pencilscan/cli/virtual_lab_run.h"

#include <Eigen/Geometry>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pencilscan/cli/interruption.h"
#include "pencilscan/cli/lab_desk.h"
#include "pencilscan/cli/own_command.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/private_network.h"
#include "pencilscan/core/random.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/display/screen_faults.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/lab/virtual_lab.h"
#include "pencilscan/lab/virtual_objects.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/rig/devices_file.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// How well a calibration of single cameras by a board knows K, one standard deviation.
constexpr double kFocalError = 1e-3;
constexpr double kCenterErrorPx = 1;
/// Three frames: more than the X server and its watch ever need.
constexpr double kSmallDelayMs = 50;
constexpr double kLostPackets = 2e-4;  ///< share: of 370 of a small picture, every 14th lacks one
constexpr double kMeanwhile = 4;       ///< s in which a capture has begun and is not over
/// s for a picture, and for a frame: six cameras of a megapixel are rendered in some seconds on a
/// computer that does other things, too.
constexpr double kPatience = 30;
constexpr const char* kFrameRate = "0.2";  ///< Hz, of the only frame: as patient
constexpr int kMostCameras = 64;           ///< addresses of the network

/// Five devices on a third of a circle, with a seventh of the usual pixels: for quick tries.
Rig small_ring() {
  RingOptions ring;
  ring.cameras = 3;
  ring.projectors = 2;
  ring.arc_rad = 2.2;
  ring.camera_width = 480;
  ring.camera_height = 360;
  ring.camera_focal_px = 860;
  ring.projector_width = 384;
  ring.projector_height = 288;
  ring.projector_focal_px = 720;
  return make_ring(ring);
}

/// What an owner of this rig knows before its calibration.
UncalibratedRig devices_of(const Rig& rig, std::uint64_t seed) {
  UncalibratedRig devices{rig, {}};
  devices.rig.floor.reset();  // of a frame that nobody knows yet
  Random random(seed, 0x6b);
  for (Camera& camera : devices.rig.cameras) {
    const double focal = 1 + kFocalError * random.normal();
    camera.K(0, 0) *= focal;
    camera.K(1, 1) *= focal;
    camera.K(0, 2) += kCenterErrorPx * random.normal();
    camera.K(1, 2) += kCenterErrorPx * random.normal();
    camera.color_matrix.reset();
    camera.color_matrix_by_projector.clear();
    devices.given.push_back({true, false, false});
  }
  for (Projector& projector : devices.rig.projectors) {
    projector.output.clear();  // lab.json names it
    devices.given.push_back({});
  }
  devices.rig.volume.reset();
  return devices;
}

/// Ten digits.
std::string digits(double value) {
  std::ostringstream text;
  text.precision(10);
  text << value;
  return text.str();
}

/// The movement of the true rig onto the calibrated one: centres of all devices on each other. What
/// is left is for the evaluation to align: a rig's frame is as good as its devices' centres.
RigidTransform calibrated_from_true(const Rig& truth, const Rig& calibrated) {
  std::vector<Vec3> from;
  std::vector<Vec3> to;
  const auto add = [&](const Device& a, const Device& b) {
    from.push_back(a.center());
    to.push_back(b.center());
  };
  for (std::size_t c = 0; c < truth.cameras.size(); ++c)
    add(truth.cameras[c], calibrated.cameras[c]);
  for (std::size_t p = 0; p < truth.projectors.size(); ++p)
    add(truth.projectors[p], calibrated.projectors[p]);
  Eigen::Matrix3Xd a(3, from.size());
  Eigen::Matrix3Xd b(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  const Eigen::Matrix4d moved = Eigen::umeyama(a, b, false);
  return {moved.topLeftCorner<3, 3>(), moved.topRightCorner<3, 1>()};
}

/// A virtual laboratory with its things.
struct VirtualPlace {
  Rig rig;
  TriangleMesh object;
  std::unique_ptr<VirtualLab> lab;
  std::uint64_t seed = 1;

  /// Writes what is true, and what an owner would know, to `out`.
  VirtualPlace(const VirtualLabCommand& command, const fs::path& out);
  /// A heap for a pose, from 1; 0: the object.
  void arrange(int pose) {
    const TriangleMesh heap =
        pose == 0 ? TriangleMesh()
                  : make_heap(working_volume(rig), seed + static_cast<std::uint64_t>(pose));
    lab->room().place(SimulatedObject(pose == 0 ? object : heap));
  }
  /// Of two cameras, as by a tape.
  [[nodiscard]] std::vector<std::string> known_distance() const {
    if (rig.cameras.size() < 2) return {};
    return {rig.cameras[0].name, rig.cameras[1].name,
            digits((rig.cameras[0].center() - rig.cameras[1].center()).norm())};
  }
};

VirtualPlace::VirtualPlace(const VirtualLabCommand& command, const fs::path& out)
    : rig(!command.rig_path.empty() ? read_rig(command.rig_path)
          : command.small           ? small_ring()
                                    : make_ring()),
      seed(command.common.seed) {
  const Sphere volume = working_volume(rig);
  object = command.mesh_path.empty() ? make_pebble(volume)
                                     : fitted(read_mesh(command.mesh_path), volume);
  for (const char* folder : {"logs", "screen", "truth"}) fs::create_directories(out / folder);
  write_rig(rig, out / "truth" / "rig.json");
  write_mesh(out / "truth" / "object.ply", object);
  write_devices(devices_of(rig, seed), out / "devices.json");
  PhotographyOptions photo;
  photo.noise = command.noise;
  photo.seed = seed;
  lab = std::make_unique<VirtualLab>(rig, out / "screen", photo);
  Lab file = lab->lab_file();
  file.patience_s = kPatience;
  if (command.small)  // nobody measures it
    for (const Projector& projector : rig.projectors) file.delay_ms[projector.name] = kSmallDelayMs;
  write_lab(file, out / "lab.json");
}

class VirtualRun {
 public:
  VirtualRun(const VirtualLabCommand& command, Interruption& interruption)
      : command_(command),
        interruption_(interruption),
        out_(fs::absolute(command.out)),
        place_(command, out_) {}
  void run();

 private:
  using Words = std::vector<std::string>;
  /// Runs a command of this program; its words go to logs/NAME.txt, its figures are returned.
  /// StageError with its complaint when it fails.
  Json step(const std::string& name, const Words& words);
  void calibrate();
  void record();
  [[nodiscard]] Json judge(const std::string& name, const fs::path& rig, const fs::path& frames,
                           const fs::path& truth);
  [[nodiscard]] Json plain_frame();
  /// Makes go wrong what was asked for, before and while a step runs.
  void break_things(const std::string& step, double seconds);
  [[nodiscard]] std::string at(const std::string& file) const { return (out_ / file).string(); }

  const VirtualLabCommand& command_;
  Interruption& interruption_;
  fs::path out_;
  VirtualPlace place_;
  std::unique_ptr<XScreen> x_;
  std::unique_ptr<ForeignWindow> window_;
  bool broken_ = false;
  Json figures_;
};

void VirtualRun::break_things(const std::string& step, double seconds) {
  const auto asked = [&](const char* fault) { return !broken_ && command_.fault == fault; };
  const bool begin = step == "test" || step == "pose1";
  if (begin && asked("late-projector")) {
    place_.lab->room().set_delay(0, 3 * kRoomExposureMs);
  } else if (begin && asked("enlarged-picture")) {
    place_.lab->room().set_zoom(0, 1.05);
  } else if (begin && asked("lost-packets")) {
    place_.lab->camera(0).set_lost_packets(kLostPackets);
  } else if (step == "pose1" && asked("window-on-top")) {
    x_ = std::make_unique<XScreen>();
    const auto outputs = x_->outputs();
    window_ = std::make_unique<ForeignWindow>(*x_, outputs[0], cv::Rect(100, 100, 90, 60), "Mail");
  } else if (step == "pose2" && seconds > kMeanwhile && asked("dead-camera")) {
    place_.lab->pull_cable(1);
  } else if (step == "record" && asked("exchanged-cables")) {
    place_.lab->room().swap_cables(0, 1);
  } else {
    return;
  }
  broken_ = true;
}

Json VirtualRun::step(const std::string& name, const Words& words) {
  break_things(name, 0);
  std::cerr << "$ pencilscan";
  for (const std::string& word : words) std::cerr << " " << word;
  std::cerr << std::endl;
  const Stopwatch watch;
  Json figures = run_own_command({words, out_ / "logs" / (name + ".txt"),
                                  out_ / "logs" / (name + ".json"), command_.common.threads},
                                 [&] {
                                   break_things(name, watch.seconds());
                                   return !interruption_.within(0);
                                 });
  figures_["seconds"][name] = watch.seconds();
  return figures;
}

void VirtualRun::calibrate() {
  Words words{"calibrate", "--devices", at("devices.json"), "--out", at("rig.json")};
  const int poses = command_.poses > 0 ? command_.poses : command_.small ? 2 : 3;
  for (int i = 1; i <= poses; ++i) {
    const std::string pose = "pose" + std::to_string(i);
    place_.arrange(i);
    if (i == 1 && !command_.small)
      step("test", {"capture", "--rig", at("devices.json"), "--lab", at("lab.json"), "--test",
                    at("lab.json")});
    Words capture{"capture", "--rig", at("devices.json"), "--lab", at("lab.json"), "--gray-code",
                  "--out",   at(pose)};
    if (!command_.small) capture.emplace_back("--solids");
    const Json taken = step(pose, capture);
    figures_["captures"][pose] = {{"pictures", taken["pictures"]},
                                  {"retaken", taken["retaken"]},
                                  {"seconds", taken["seconds"]}};
    words.insert(words.end(), {"--captures", at(pose)});
  }
  if (const auto distance = place_.known_distance(); !distance.empty()) {
    words.emplace_back("--known-distance");
    words.insert(words.end(), distance.begin(), distance.end());
  }
  const Json found = step("calibrate", words);
  for (const char* key : {"verdict", "rms_px", "held_out_rms_px"})
    figures_["calibration"][key] = found[key];
}

void VirtualRun::record() {
  place_.arrange(0);
  step("record",
       {"capture", "--rig", at("rig.json"), "--lab", at("lab.json"), "--show", "--frames", "1",
        "--still", "--rate", command_.small ? "1" : kFrameRate, "--out", at("frames")});
}

Json VirtualRun::judge(const std::string& name, const fs::path& rig, const fs::path& frames,
                       const fs::path& truth) {
  const fs::path result = out_ / ("result" + name);
  step("reconstruct" + name, {"reconstruct", "--rig", rig.string(), "--frames", frames.string(),
                              "--out", result.string()});
  const Json all =
      step("evaluate" + name, {"evaluate", "--truth", truth.string(), "--rig", rig.string(),
                               "--result", (result / "000000").string(), "--align", "rigid"});
  Json chosen;
  for (const char* key : {"points", "label_error", "line_recall", "distance_median_mm",
                          "mesh_distance_median_mm", "completeness_1mm"})
    chosen[key] = all[key];
  return chosen;
}

Json VirtualRun::plain_frame() {
  step("simulate",
       {"simulate", "--rig", at("truth/rig.json"), "--mesh", at("truth/object.ply"), "--pixelated",
        "--black-level", "0.004", "--noise", command_.noise, "--out", at("plain")});
  return judge("_plain", out_ / "truth" / "rig.json", out_ / "plain" / "frames",
               out_ / "truth" / "object.ply");
}

void VirtualRun::run() {
  const Stopwatch watch;
  calibrate();
  record();
  const fs::path truth = out_ / "truth" / "mesh.ply";
  write_mesh(truth, transformed(place_.object,
                                calibrated_from_true(place_.rig, read_rig(out_ / "rig.json"))));
  figures_["laboratory"] = judge("", out_ / "rig.json", out_ / "frames", truth);
  figures_["simulated"] = plain_frame();
  figures_["seconds"]["all"] = watch.seconds();
  print_figures(command_.common, figures_);
}

}  // namespace

const std::vector<std::string>& virtual_faults() {
  static const std::vector<std::string> names{"late-projector", "enlarged-picture",
                                              "window-on-top",  "lost-packets",
                                              "dead-camera",    "exchanged-cables"};
  return names;
}

void check_virtual_folder(const VirtualLabCommand& command) {
  std::error_code ignored;
  if (fs::exists(command.out, ignored) &&
      (!fs::is_directory(command.out, ignored) || !fs::is_empty(command.out, ignored)))
    throw InputError("command line", "--out", command.out, "must be a new or empty folder");
}

void run_virtual_lab(const VirtualLabCommand& command, Interruption& interruption) {
  check_virtual_folder(command);
  enter_private_network(kMostCameras);
  const ThreadLimit threads(command.common.threads);
  VirtualRun(command, interruption).run();
}

void serve_virtual_lab(const VirtualLabCommand& command, LabServer& server,
                       Interruption& interruption) {
  check_virtual_folder(command);
  enter_private_network(kMostCameras);
  const ThreadLimit threads(command.common.threads);
  const fs::path out = fs::absolute(command.out);
  VirtualPlace place(command, out);
  place.arrange(1);
  LabDeskOptions options;
  options.rig = out / "devices.json";
  options.lab = read_lab(out / "lab.json");
  options.lab_source = (out / "lab.json").string();
  options.out = out;
  options.known_distance = place.known_distance();
  options.threads = command.common.threads;
  options.arrange = [&place](int pose) { place.arrange(pose); };
  serve_lab(std::move(options), server, interruption);
}

}  // namespace pencilscan::cli
