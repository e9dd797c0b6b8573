#include "pencilscan/cli/lab_desk.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "pencilscan/capture/projector_tests.h"
#include "pencilscan/cli/lab_camera_view.h"
#include "pencilscan/cli/lab_devices.h"
#include "pencilscan/cli/lab_work.h"
#include "pencilscan/cli/own_command.h"
#include "pencilscan/cli/pose_cover.h"
#include "pencilscan/cli/serve.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/file.h"
#include "pencilscan/report/labelled_share.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Values = std::map<std::string, std::string>;

constexpr auto kPulse = std::chrono::milliseconds(250);     ///< between previews that we trigger
constexpr auto kLookEvery = std::chrono::milliseconds(10);  ///< for whether they have come
/// One picture that is told to be taken may take its time.
constexpr double kCalmRateHz = 1;

const std::vector<std::string>& shown_names() {
  static const std::vector<std::string> names{"black", "white",   "lines", "identify",
                                              "focus", "columns", "rows",  "grey50"};
  return names;
}

std::optional<double> number_in(const Values& values, const std::string& name) {
  const auto found = values.find(name);
  if (found == values.end()) return std::nullopt;
  const std::string& text = found->second;
  double number = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size() || !std::isfinite(number))
    return std::nullopt;
  return number;
}

bool is_calibrated(const fs::path& rig) {
  try {
    static_cast<void>(read_rig(rig));
    return true;
  } catch (const InputError&) {
    return false;
  }
}

class Desk final : public LabDesk {
 public:
  explicit Desk(LabDeskOptions options);
  ~Desk() override;

  Json status() override;
  std::string preview(std::size_t camera) override { return view_->preview(camera); }
  std::string act(const std::string& action, const Values& values) override;

 private:
  [[nodiscard]] std::string next_step() const;
  /// The calibrated rig: of this desk, or the given one; empty: there is none yet.
  [[nodiscard]] fs::path calibrated_rig() const;
  /// What work_.begin() says; previews wait until the work is done.
  [[nodiscard]] std::string begin(const std::string& what, std::function<void()> work);
  void pulse();
  void take_previews();
  void show(const ProjectorPicture& picture, const std::string& projector);
  std::string set_camera(const Values& values);
  void flash();
  void capture();
  void calibrate();
  void record();
  [[nodiscard]] Json run(const std::vector<std::string>& words, const std::string& name);
  [[nodiscard]] std::string at(const std::string& file) const {
    return (options_.out / file).string();
  }

  LabDeskOptions options_;
  Rig rig_;
  std::unique_ptr<LiveCameras> cameras_;
  std::unique_ptr<ProjectorScreen> screen_;
  std::optional<LabCameraView> view_;
  bool given_calibrated_ = false;

  mutable std::mutex mutex_;  ///< of what follows
  std::string showing_;
  int poses_ = 0;
  PoseCover cover_;
  Json calibration_;
  Json frame_;

  std::mutex cameras_in_use_;  ///< by work or by previews
  LabWork work_;
  std::atomic<bool> ending_ = false;
  std::thread pulse_;
};

Desk::Desk(LabDeskOptions options)
    : options_(std::move(options)), rig_(read_devices(options_.rig).rig), cover_(rig_.cameras) {
  fs::create_directories(options_.out / "logs");
  cameras_ = start_lab_cameras(rig_, options_.lab, options_.lab_source);
  screen_ = open_lab_screen(rig_, options_.lab, options_.rig.string(), options_.lab_source);
  view_.emplace(rig_, *cameras_);
  given_calibrated_ = is_calibrated(options_.rig);
  calibration_ = {{"verdict", ""}, {"rms_px", 0}, {"poses", 0}, {"reasons", Json::array()}};
  frame_ = {{"points", 0}, {"labelled_share", 0}, {"folder", ""}};
  while (fs::exists(options_.out / ("pose" + std::to_string(poses_ + 1)))) ++poses_;
  show({}, "");
  if (options_.lab.trigger == Trigger::kSoftware) pulse_ = std::thread([this] { pulse(); });
}

Desk::~Desk() {
  ending_ = true;
  work_.end();
  if (pulse_.joinable()) pulse_.join();
}

std::string Desk::begin(const std::string& what, std::function<void()> work) {
  return work_.begin(what, [this, work = std::move(work)] {
    const std::lock_guard in_use(cameras_in_use_);
    work();
  });
}

/// Cameras that take a picture only when they are told to: a few a second, while nothing else tells
/// them.
void Desk::pulse() {
  while (!ending_) {
    if (!work_.running()) take_previews();
    std::this_thread::sleep_for(kPulse);
  }
}

/// A picture of each camera. Waits for programs that take them: their pictures would pile up, and
/// come when something else is shown. A camera that loses one has lost it, and others go on.
void Desk::take_previews() {
  const std::lock_guard in_use(cameras_in_use_);
  const auto pictures = [this](std::size_t camera) {
    const LiveCameras::Count count = cameras_->count(camera);
    return count.whole + count.incomplete;
  };
  const auto is_at_fault = [this](std::size_t camera) {
    const std::vector<Fault> faults = cameras_->group().faults();
    return std::any_of(faults.begin(), faults.end(), [&](const Fault& fault) {
      return fault.device == rig_.cameras[camera].name;
    });
  };
  std::vector<std::pair<std::size_t, std::size_t>> awaited;  // camera, its pictures before
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c)
    if (cameras_->group().info(c).of_files) awaited.emplace_back(c, pictures(c));
  const Stopwatch waited;
  cameras_->group().trigger();
  for (const auto& [camera, before] : awaited) {
    while (!ending_ && waited.seconds() < options_.lab.patience_s && pictures(camera) == before &&
           !is_at_fault(camera))
      std::this_thread::sleep_for(kLookEvery);
  }
}

void Desk::show(const ProjectorPicture& picture, const std::string& projector) {
  for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
    const bool shows = projector.empty() || rig_.projectors[p].name == projector;
    screen_->show(p, shows ? picture : ProjectorPicture{});
  }
  const std::lock_guard lock(mutex_);
  showing_ = to_string(picture) + (projector.empty() ? "" : " on " + projector);
}

fs::path Desk::calibrated_rig() const {
  if (fs::exists(at("rig.json"))) return at("rig.json");
  return given_calibrated_ ? options_.rig : fs::path();
}

std::string Desk::next_step() const {
  if (poses_ == 0)
    return "Put something with depth into the volume (a heap of matt light things), and capture "
           "it. Nothing may move meanwhile.";
  const std::string cell = cover_.emptiest_cell();
  return "Move and turn the object" +
         (cell.empty() ? std::string(": every camera has seen something everywhere.")
                       : "; " + cell + " of its picture.");
}

Json Desk::status() {
  std::string showing;
  {
    const std::lock_guard lock(mutex_);
    showing = showing_;
  }
  Json status;
  status["cameras"] = Json::array();
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c)
    status["cameras"].push_back(view_->status(c, showing));
  status["projectors"] = Json::array();
  for (const Projector& projector : rig_.projectors) status["projectors"].push_back(projector.name);
  status["pictures"] = shown_names();
  const std::lock_guard lock(mutex_);
  status["showing"] = showing_;
  status["job"] = work_.json();
  status["poses"] = poses_;
  status["next"] = next_step();
  status["calibrated"] = !calibrated_rig().empty();
  status["cover"] = cover_.json();
  status["calibration"] = calibration_;
  status["frame"] = frame_;
  status["said"] = work_.said();
  return status;
}

std::string Desk::act(const std::string& action, const Values& values) {
  const auto value = [&](const char* name) {
    const auto found = values.find(name);
    return found == values.end() ? std::string() : found->second;
  };
  if (action == "stop") {
    work_.stop();
    return "";
  }
  if (action == "set") return set_camera(values);
  if (action == "show") {
    const auto picture = picture_from_text(value("what"));
    const std::string projector = value("projector");
    const bool known =
        projector.empty() || std::any_of(rig_.projectors.begin(), rig_.projectors.end(),
                                         [&](const Projector& p) { return p.name == projector; });
    if (!picture || !known) return "no such picture or projector";
    return begin("showing", [this, picture = *picture, projector] { show(picture, projector); });
  }
  if (action == "test") return begin("flashing", [this] { flash(); });
  if (action == "capture") return begin("capturing", [this] { capture(); });
  if (action == "calibrate") return begin("calibrating", [this] { calibrate(); });
  if (action == "record" && calibrated_rig().empty())
    return "a frame needs a calibrated rig: capture poses first";
  if (action == "record") return begin("recording", [this] { record(); });
  return "no such button";
}

std::string Desk::set_camera(const Values& values) {
  const auto camera = number_in(values, "camera");
  const auto exposure = number_in(values, "exposure_ms");
  if (!camera || *camera < 0 || *camera >= static_cast<double>(rig_.cameras.size()) || !exposure ||
      *exposure <= 0)
    return "an exposure is a number of milliseconds above zero";
  if (*exposure > kLongestExposureMs)
    return "an exposure is at most " + formatted(kLongestExposureMs, "%.0f") + " ms";
  const auto index = static_cast<std::size_t>(*camera);
  LabCamera& wanted = options_.lab.cameras[rig_.cameras[index].name];
  return begin("setting", [this, index, &wanted, exposure, gain = number_in(values, "gain")] {
    LabCamera changed = wanted;
    changed.exposure_ms = *exposure;
    if (gain) changed.gain = *gain;
    Lab lab = options_.lab;
    lab.cameras[rig_.cameras[index].name] = changed;
    cameras_->group().configure(index, settings_for(lab, rig_.cameras[index]));
    // As the camera made it: it may round.
    const CameraSettings made = cameras_->group().settings(index);
    if (made.exposure_us) changed.exposure_ms = *made.exposure_us / 1000;
    if (made.gain) changed.gain = *made.gain;
    wanted = changed;
    write_lab(options_.lab, at("lab.json"));
  });
}

void Desk::flash() {
  ProjectorTestReport report = test_projectors(*cameras_, *screen_, test_options(options_.lab),
                                               [this](const std::string& what, double share) {
                                                 return work_.progress("flashing " + what, share);
                                               });
  for (Fault& fault : screen_->check()) report.faults.push_back(std::move(fault));
  for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
    const ProjectorTiming& timing = report.projectors[p];
    if (!timing.measured) continue;
    const std::string& name = rig_.projectors[p].name;
    options_.lab.delay_ms[name] = timing.use_ms;
    std::string seen;
    for (std::size_t c = 0; c < timing.views.size(); ++c)
      if (timing.views[c].share > 0)
        add_name(seen, rig_.cameras[c].name + " " +
                           std::to_string(std::lround(100 * timing.views[c].share)) + " %");
    work_.say(name + ": its light comes after " + std::to_string(std::lround(timing.most_ms)) +
              " ms; of their pictures it lights: " + seen);
  }
  write_lab(options_.lab, at("lab.json"));
  work_.say(report.faults);
  show({}, "");
}

void Desk::capture() {
  const std::string pose = "pose" + std::to_string(poses_ + 1);
  if (options_.arrange) options_.arrange(poses_ + 1);
  GrayCaptureOptions options = gray_options(rig_, options_.lab);
  options.solids = true;
  // Into a folder of its own until it is whole, so that what was stopped goes on.
  const fs::path part = options_.out / (pose + ".part");
  const GrayCaptureReport report = capture_gray_codes(
      *cameras_, *screen_, rig_, part, options, [&](const std::string& what, double share) {
        return work_.progress("capturing " + pose + ", " + what, share);
      });
  work_.say(report.faults);
  const bool whole = std::all_of(rig_.projectors.begin(), rig_.projectors.end(),
                                 [&](const Projector& p) { return fs::exists(part / p.name); });
  show({}, "");
  for (const std::string& projector : report.refused)
    work_.say(pose + ": the pictures of " + projector + " are taken anew", true);
  if (!whole) return work_.say(pose + " is not whole: press the button again to go on", true);
  if (!report.faults.empty()) {
    fs::remove_all(part);
    return work_.say(pose + " was not kept: capture it again", true);
  }
  fs::rename(part, options_.out / pose);
  {
    const std::lock_guard lock(mutex_);
    cover_.add(report.views);
    ++poses_;
  }
  work_.say(pose + ": " + std::to_string(report.pictures) + " pictures in " +
            std::to_string(std::lround(report.seconds)) + " s, " + std::to_string(report.retaken) +
            " of them taken again");
  calibrate();
}

Json Desk::run(const std::vector<std::string>& words, const std::string& name) {
  const OwnCommand command{words, options_.out / "logs" / (name + ".txt"),
                           options_.out / "logs" / (name + ".json"), options_.threads};
  return run_own_command(command, [&] { return work_.progress(last_line(command.log), 0); });
}

void Desk::calibrate() {
  std::vector<std::string> words{"calibrate", "--devices",    options_.rig.string(),
                                 "--out",     at("rig.json"), "--overwrite"};
  for (int i = 1; i <= poses_; ++i)
    words.insert(words.end(), {"--captures", at("pose" + std::to_string(i))});
  if (!options_.known_distance.empty()) {
    words.emplace_back("--known-distance");
    words.insert(words.end(), options_.known_distance.begin(), options_.known_distance.end());
  }
  Json found;
  try {
    found = run(words, "calibrate");
  } catch (const StageError&) {
    if (work_.stopping() || !fs::exists(at("logs/calibrate.json"))) throw;
    found = Json(read_json(at("logs/calibrate.json")));  // an unusable rig has figures, too
  }
  Json reasons = Json::array();
  std::ifstream log(at("logs/calibrate.txt"));
  for (std::string line; std::getline(log, line);)
    if (line.starts_with("good: ") || line.starts_with("doubtful: ") ||
        line.starts_with("unusable: ") || line.starts_with("  what to do: "))
      reasons.push_back(line);
  const std::lock_guard lock(mutex_);
  calibration_ = {{"verdict", found.value("verdict", "unusable")},
                  {"rms_px", found.contains("rms_px") && found["rms_px"].is_number()
                                 ? found["rms_px"].get<double>()
                                 : 0.0},
                  {"poses", poses_},
                  {"reasons", std::move(reasons)}};
}

void Desk::record() {
  const fs::path rig = calibrated_rig();
  if (options_.arrange) options_.arrange(0);
  show({ProjectorPicture::Kind::kLines, 0, {}}, "");
  int number = 1;
  while (fs::exists(options_.out / ("frame" + std::to_string(number)))) ++number;
  const std::string name = "frame" + std::to_string(number);
  RecordOptions options = record_options(options_.lab, true);
  options.frames = 1;
  if (options.software_trigger) options.rate_hz = std::min(options.rate_hz, kCalmRateHz);
  RecordReport report =
      pencilscan::record(*cameras_, rig_, options_.out / name, options,
                         [&](const RecordReport&) { return work_.progress("taking a frame", 0); });
  for (Fault& fault : screen_->check()) report.faults.push_back(std::move(fault));
  work_.say(report.faults);
  if (report.frames == 0) throw StageError("not a single frame came");
  static_cast<void>(run({"reconstruct", "--rig", rig.string(), "--frames", at(name), "--out",
                         at(name + "_points"), "--no-mesh", "--no-pictures"},
                        name));
  const auto result = read_json(options_.out / (name + "_points") / "000000" / "report.json");
  for (const auto& warning : result.at("warnings")) work_.say(warning.get<std::string>(), true);
  const std::lock_guard lock(mutex_);
  frame_ = {{"points", result.at("points")},
            {"labelled_share", labelled_share(result).value_or(0)},
            {"folder", name + "_points"}};
}

}  // namespace

void serve_lab(LabDeskOptions options, LabServer& server, Interruption& interruption) {
  Desk desk(std::move(options));
  server.set_desk(desk);
  std::cout << "address " << server.link() << std::endl;
  serve(server, interruption);
}

}  // namespace pencilscan::cli
