#include "pencilscan/capture/gray_capture.h"

#include <algorithm>
#include <set>
#include <thread>

#include "pencilscan/capture/camera_picture.h"
#include "pencilscan/capture/capture_note.h"
#include "pencilscan/capture/work_queue.h"
#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/image.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/pattern/solid_color.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using Kind = ProjectorPicture::Kind;

/// Where nobody measured: projectors of three frames' delay, and a slow network.
constexpr double kGuessedFrames = 3;
constexpr double kGuessedTransferMs = 60;
/// Added to the delay when a picture is taken again.
constexpr double kRetakeMs = 50;
/// A camera without a picture so many times in a row gives none any more.
constexpr int kMostMissing = 4;
/// Pictures of all cameras that may wait to be written: half a gigabyte at most.
constexpr std::size_t kWaitingPictures = 24;

/// A picture of the sequence and the file it becomes.
struct Shot {
  ProjectorPicture picture;
  std::string file;
};

/// The sequence as files; with inverses, a pattern is followed by its inverse.
std::vector<Shot> shots_of(const Projector& projector, const GrayCaptureOptions& options) {
  std::vector<Shot> shots;
  const auto wanted = gray_code_sequence(projector.width, projector.height, options.inverses);
  const auto all = gray_code_sequence(projector.width, projector.height, true);
  for (std::size_t i = 0, k = 0; k < wanted.size(); ++i) {
    if (!options.inverses && all[i].inverse) continue;
    shots.push_back({{Kind::kGray, i, {}}, gray_code_file_stem(k++) + ".png"});
  }
  if (!options.solids) return shots;
  for (const SolidImage& solid : solid_images())
    shots.push_back({{Kind::kSolid, 0, solid.value}, solid.name + ".png"});
  return shots;
}

/// One projector's pictures while they are taken.
class ProjectorRun {
 public:
  ProjectorRun(LiveCameras& cameras, ProjectorScreen& screen, const fs::path& folder,
               std::size_t projector, const Rig& rig, const GrayCaptureOptions& options,
               GrayCaptureReport& report)
      : cameras_(cameras),
        screen_(screen),
        rig_(rig),
        folder_(folder),
        projector_(projector),
        options_(options),
        report_(report),
        faults_before_(report.faults.size()),
        shots_(shots_of(screen.projectors()[projector], options)),
        coarse_(shots_.size() + 1, std::vector<cv::Mat>(cameras.group().size())),
        missing_in_a_row_(cameras.group().size(), 0),
        work_(static_cast<std::size_t>(thread_count())) {}

  /// False when `watch` asked to stop, or a camera is gone.
  bool run(const std::function<bool(double share)>& watch);
  /// Waits until all pictures so far are written.
  void finish() { work_.wait(); }
  /// False where a fault makes the pictures useless.
  [[nodiscard]] bool usable() const;
  /// Something moved meanwhile.
  [[nodiscard]] bool moved() const { return moved_; }
  /// Removes the folders of cameras that see nothing.
  void drop_unseen() const;

 private:
  [[nodiscard]] double delay_ms() const;
  /// Shows and takes shot i; `again` >= 1: a retake. Index shots_.size() is white once more.
  void take(std::size_t i, int again = 0);
  [[nodiscard]] std::string name_of(std::size_t camera) const {
    return cameras_.group().name(camera);
  }
  [[nodiscard]] const Shot& shot(std::size_t i) const {
    return i < shots_.size() ? shots_[i] : shots_[0];
  }
  void judge_whites();
  /// Shots to take again. `last`: nobody will, and what a camera lacks of them is a fault.
  [[nodiscard]] std::set<std::size_t> failed(bool last);
  /// A fault of the camera, unless it has one of this kind already; `why` its picture is none.
  void give_up(std::size_t camera, std::size_t i, const std::string& why);
  /// Why there is no picture of a camera, as far as that is known.
  [[nodiscard]] std::string why_missing(std::size_t camera) const;
  /// True, with a fault, when a camera gives no pictures any more: waiting for each of them would
  /// take minutes.
  [[nodiscard]] bool lost_a_camera();
  void judge_stillness();
  /// Share of a camera's picture that changes at all during the sequence.
  [[nodiscard]] double changing_share(std::size_t camera) const;

  LiveCameras& cameras_;
  ProjectorScreen& screen_;
  const Rig& rig_;
  const fs::path folder_;
  std::size_t projector_;
  const GrayCaptureOptions& options_;
  GrayCaptureReport& report_;
  std::size_t faults_before_;  ///< of other projectors
  std::vector<Shot> shots_;
  std::vector<std::vector<cv::Mat>> coarse_;  ///< [shot][camera]; empty: none came
  std::vector<int> missing_in_a_row_;         ///< per camera
  std::vector<LitView> views_;
  bool moved_ = false;
  WorkQueue work_;  ///< last: its threads use all of the above until they have ended
};

double ProjectorRun::delay_ms() const {
  if (projector_ < options_.delay_ms.size() && options_.delay_ms[projector_] > 0)
    return options_.delay_ms[projector_];
  const double refresh = screen_.refresh_hz(projector_);
  double exposure_ms = 0;
  for (std::size_t c = 0; c < cameras_.group().size(); ++c)
    exposure_ms =
        std::max(exposure_ms, cameras_.group().settings(c).exposure_us.value_or(0) / 1000);
  return 1000 * kGuessedFrames / (refresh > 0 ? refresh : ProjectorScreen::kUsualRefreshHz) +
         exposure_ms + kGuessedTransferMs;
}

void ProjectorRun::take(std::size_t i, int again) {
  const Stopwatch watch;
  const std::int64_t shown = screen_.show(projector_, shot(i).picture);
  const std::vector<TimedFrame> frames = cameras_.taken_since(
      shown + static_cast<std::int64_t>(1e6 * (delay_ms() + kRetakeMs * again)),
      options_.patience_s);
  report_.waiting_seconds += static_cast<double>(host_now_ns() - shown) / 1e9;
  ++report_.pictures;
  work_.wait(kWaitingPictures);
  for (std::size_t c = 0; c < frames.size(); ++c) {
    coarse_[i][c].release();
    missing_in_a_row_[c] = frames[c].frame ? 0 : missing_in_a_row_[c] + 1;
    if (!frames[c].frame) continue;
    work_.add([this, i, c, frame = frames[c].frame] {
      const cv::Mat picture = picture_for_files(rig_.cameras[c], *frame);
      coarse_[i][c] = coarse_picture(picture);
      if (i < shots_.size()) write_image(folder_ / name_of(c) / shots_[i].file, picture);
    });
  }
}

std::string ProjectorRun::why_missing(std::size_t camera) const {
  const LiveCameras::Count count = cameras_.count(camera);
  if (count.incomplete == 0) return "no picture came";
  if (!count.trouble.empty()) return "no picture can be used: " + count.trouble;
  return "no picture came whole: " + std::to_string(count.incomplete) + " of " +
         std::to_string(count.incomplete + count.whole) + " lack packets that the network lost";
}

bool ProjectorRun::lost_a_camera() {
  bool lost = false;
  for (Fault& fault : cameras_.group().faults()) {
    lost = lost || fault.kind == "dead";
    if (fault.kind == "dead") report_.faults.push_back(std::move(fault));
  }
  for (std::size_t c = 0; !lost && c < missing_in_a_row_.size(); ++c) {
    if (missing_in_a_row_[c] < kMostMissing) continue;
    lost = true;
    report_.faults.push_back(
        {"missing", name_of(c),
         why_missing(c) + ", " + std::to_string(missing_in_a_row_[c]) + " times in a row",
         "check the camera, its trigger and its network"});
  }
  return lost;
}

void ProjectorRun::judge_whites() {
  views_.assign(cameras_.group().size(), {});
  for (std::size_t c = 0; c < views_.size(); ++c)
    if (!coarse_[0][c].empty() && !coarse_[1][c].empty())
      views_[c] = lit_view(coarse_[0][c], coarse_[1][c]);
}

void ProjectorRun::give_up(std::size_t camera, std::size_t i, const std::string& why) {
  const std::string& projector = screen_.projectors()[projector_].name;
  const bool missing = coarse_[i][camera].empty();
  for (std::size_t f = faults_before_; f < report_.faults.size(); ++f)
    if (report_.faults[f].device == name_of(camera) &&
        report_.faults[f].kind == (missing ? "missing" : "picture"))
      return;
  report_.faults.push_back({missing ? "missing" : "picture", name_of(camera),
                            to_string(shot(i).picture) + " of " + projector + " after " +
                                std::to_string(options_.retakes) + " more tries: " + why,
                            missing
                                ? "check the camera, its trigger and its network"
                                : "keep everything still; measure the projectors' delay again"});
}

std::set<std::size_t> ProjectorRun::failed(bool last) {
  std::set<std::size_t> again;
  judge_whites();
  const std::size_t white_again = shots_.size();
  for (std::size_t c = 0; c < views_.size(); ++c) {
    for (std::size_t i = 0; i <= shots_.size(); ++i) {
      if (!coarse_[i][c].empty()) continue;
      again.insert(i);
      if (last) give_up(c, i, why_missing(c));
    }
    // A camera that sees nothing between white and black, and then something: these came late.
    if (!views_[c].is_seen()) {
      if (changing_share(c) < LitView::kLeastSeen) continue;
      // Then every picture may show the one before: pairs would not tell.
      for (std::size_t i = 0; i <= white_again; ++i) again.insert(i);
      if (last) give_up(c, 0, "white and black came late");
      continue;
    }
    if (!options_.inverses) continue;
    const std::size_t patterns = gray_code_sequence(screen_.projectors()[projector_].width,
                                                    screen_.projectors()[projector_].height)
                                     .size();
    for (std::size_t i = 2; i + 1 < patterns; i += 2) {
      if (coarse_[i][c].empty() || coarse_[i + 1][c].empty()) continue;
      const std::string why = pair_trouble(coarse_[i][c], coarse_[i + 1][c], views_[c]);
      if (why.empty()) continue;
      again.insert({i, i + 1});
      if (last) give_up(c, i, why);
    }
  }
  return again;
}

double ProjectorRun::changing_share(std::size_t camera) const {
  cv::Mat low;
  cv::Mat high;
  for (const auto& shot : coarse_) {
    if (shot[camera].empty()) continue;
    low = low.empty() ? shot[camera].clone() : cv::Mat(cv::min(low, shot[camera]));
    high = high.empty() ? shot[camera].clone() : cv::Mat(cv::max(high, shot[camera]));
  }
  return low.empty() ? 0 : lit_view(high, low).share;
}

void ProjectorRun::judge_stillness() {
  for (std::size_t c = 0; c < views_.size(); ++c) {
    const cv::Mat& again = coarse_[shots_.size()][c];
    if (!views_[c].is_seen() || again.empty()) continue;
    const WhiteTrouble trouble = white_again_trouble(coarse_[0][c], again, views_[c]);
    if (trouble.why.empty()) continue;
    moved_ = moved_ || trouble.moved;
    report_.faults.push_back({"moved", name_of(c),
                              "under " + screen_.projectors()[projector_].name + ": " + trouble.why,
                              "take this pose again"});
  }
}

bool ProjectorRun::run(const std::function<bool(double share)>& watch) {
  const std::size_t count = shots_.size() + 1;
  // The light of the projector before has to be gone.
  const std::int64_t dark = screen_.show(projector_, {});
  (void)cameras_.first_since(dark + static_cast<std::int64_t>(1e6 * delay_ms()),
                             dark + static_cast<std::int64_t>(1e6 * delay_ms() + 5e8));
  for (std::size_t i = 0; i < count; ++i) {
    take(i);
    if (lost_a_camera()) return false;
    if (!watch(static_cast<double>(i + 1) / static_cast<double>(count))) return false;
  }
  work_.wait();
  for (int round = 1; round <= options_.retakes; ++round) {
    const auto again = failed(false);
    if (again.empty()) break;
    for (const std::size_t i : again) {
      take(i, round);
      ++report_.retaken;
      if (lost_a_camera() || !watch(1)) return false;
    }
    work_.wait();
  }
  (void)failed(true);
  judge_stillness();
  report_.views[projector_] = views_;
  const bool seen =
      std::any_of(views_.begin(), views_.end(), [](const LitView& view) { return view.is_seen(); });
  if (!seen)
    report_.faults.push_back({"unseen", screen_.projectors()[projector_].name,
                              "no camera sees any of its light",
                              "lamp on? lens cap? the right output? exposure long enough?"});
  screen_.show(projector_, {});
  return true;
}

bool ProjectorRun::usable() const {
  static const std::set<std::string> kUseless{"picture", "missing", "moved", "unseen"};
  return std::none_of(report_.faults.begin() + static_cast<std::ptrdiff_t>(faults_before_),
                      report_.faults.end(),
                      [](const Fault& fault) { return kUseless.contains(fault.kind); });
}

void ProjectorRun::drop_unseen() const {
  for (std::size_t c = 0; c < views_.size(); ++c)
    if (!views_[c].is_seen()) fs::remove_all(folder_ / name_of(c));
}

/// Where a projector's pictures are until they are complete.
fs::path part_of(const fs::path& out, const std::string& projector) {
  return out / ("." + projector + ".part");
}

/// Takes back the projectors before this one that are there, but for those of other programs.
void refuse_earlier(const std::vector<Projector>& projectors, std::size_t before,
                    const fs::path& out, GrayCaptureReport& report) {
  for (std::size_t p = 0; p < before; ++p) {
    const std::string& name = projectors[p].name;
    if (!has_capture_note(out / name)) continue;
    fs::remove_all(part_of(out, name));
    fs::rename(out / name, part_of(out, name));
    report.refused.push_back(name);
  }
}

}  // namespace

GrayCaptureReport capture_gray_codes(LiveCameras& cameras, ProjectorScreen& screen, const Rig& rig,
                                     const fs::path& out, const GrayCaptureOptions& options,
                                     const GrayCaptureWatch& watch, const ProjectorDone& done) {
  PENCILSCAN_CHECK(rig.cameras.size() == cameras.group().size());
  GrayCaptureReport report;
  const Stopwatch clock;
  const std::size_t projectors = screen.projectors().size();
  const auto note_of = [&](std::size_t p) {
    return capture_note(screen.projectors()[p], rig.cameras, options.inverses, options.solids);
  };
  for (std::size_t p = 0; p < projectors; ++p)
    check_capture_note(out / screen.projectors()[p].name, note_of(p));
  report.views.assign(projectors, std::vector<LitView>(cameras.group().size()));
  screen.show_all({});
  for (std::size_t p = 0; p < projectors; ++p) {
    const std::string& name = screen.projectors()[p].name;
    if (fs::exists(out / name) && !fs::is_empty(out / name)) {
      ++report.resumed;
      continue;
    }
    const fs::path part = part_of(out, name);
    fs::remove_all(part);
    fs::create_directories(part);
    ProjectorRun run(cameras, screen, part, p, rig, options, report);
    const bool whole = run.run([&](double share) {
      return !watch ||
             watch(name, (static_cast<double>(p) + share) / static_cast<double>(projectors));
    });
    report.seconds = clock.seconds();
    if (!whole) {
      run.finish();
      fs::remove_all(part);
      screen.show_all({});
      return report;
    }
    run.drop_unseen();
    write_capture_note(part, note_of(p));
    if (run.moved()) refuse_earlier(screen.projectors(), p, out, report);
    if (run.usable()) {
      fs::rename(part, out / name);
      if (done) done(p);
    } else {
      report.refused.push_back(name);
    }
  }
  for (Fault& fault : screen.check()) report.faults.push_back(std::move(fault));
  report.seconds = clock.seconds();
  return report;
}

}  // namespace pencilscan
