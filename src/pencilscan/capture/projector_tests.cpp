#include "pencilscan/capture/projector_tests.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/random.h"

namespace pencilscan {
namespace {

using Kind = ProjectorPicture::Kind;

constexpr double kAllLight = 0.95;  ///< of a change: what is left is noise and scattered light
/// Nothing takes longer from show() to a picture: projectors of three frames, exposures of 100 ms,
/// networks that are busy.
constexpr double kLongestMs = 400;
constexpr int kSteps = 7;  ///< halvings of that, with a software trigger
/// What lamps and sensors of usable projectors change by from picture to picture.
constexpr double kSteadyLight = 0.02;
/// Exposures this far from a whole number of periods, in periods, show it: 2 % of light at one
/// period.
constexpr double kPeriodSlack = 0.02;

constexpr std::int64_t ns(double ms) { return static_cast<std::int64_t>(1e6 * ms); }

/// Share of the change from black to white that a picture has, over the lit blocks.
double level_of(const cv::Mat& coarse, const LitView& view) {
  double light = 0;
  double all = 0;
  for (int y = 0; y < coarse.rows; ++y) {
    for (int x = 0; x < coarse.cols; ++x) {
      if (view.lit.at<std::uint8_t>(y, x) == 0) continue;
      light += coarse.at<float>(y, x) - view.black.at<float>(y, x);
      all += view.light.at<float>(y, x);
    }
  }
  return all > 0 ? light / all : 0;
}

/// What one flash says of the delay in one camera, ms.
struct Bounds {
  double least = 0;
  double most = std::numeric_limits<double>::infinity();
};

/// More flashes than this share that came at another time are the projector's doing: a computer
/// that pauses hits one or two in a row.
constexpr double kFewStrays = 0.25;

/// The delays that most flashes allow; of several such, the shortest: a busy computer makes light
/// late and never early.
Bounds agreed(const std::vector<Bounds>& flashes) {
  Bounds best;
  std::size_t most = 0;
  for (const Bounds& first : flashes) {  // what several have in common begins with one of them
    Bounds common{first.least, std::numeric_limits<double>::infinity()};
    std::size_t count = 0;
    for (const Bounds& flash : flashes) {
      if (flash.least > first.least || flash.most < first.least) continue;
      common.most = std::min(common.most, flash.most);
      ++count;
    }
    if (count < most || (count == most && common.least >= best.least)) continue;
    best = common;
    most = count;
  }
  return best;
}

class Tester {
 public:
  Tester(LiveCameras& cameras, ProjectorScreen& screen, const ProjectorTestOptions& options)
      : cameras_(cameras),
        screen_(screen),
        options_(options),
        software_(cameras.group().size() > 0 &&
                  cameras.group().settings(0).trigger == Trigger::kSoftware) {}

  ProjectorTiming test(std::size_t projector, std::vector<Fault>& faults);

 private:
  /// One picture of every camera, that begins when everything shown now is there.
  [[nodiscard]] std::vector<cv::Mat> settled_pictures();
  /// Of all cameras, taken so long from now or later.
  [[nodiscard]] std::vector<TimedFrame> pictures_after(double ms);
  void look(std::size_t projector, ProjectorTiming& timing);
  void judge_flicker(std::size_t projector, ProjectorTiming& timing, std::vector<Fault>& faults);
  /// Adds what this flash says to every camera's.
  void flash(std::size_t projector, bool white, const ProjectorTiming& timing,
             std::vector<std::vector<Bounds>>& flashes);
  /// One picture, so long after the flash; whether the light was there before it in all cameras.
  bool flash_triggered(std::size_t projector, bool white, const ProjectorTiming& timing,
                       std::vector<std::vector<Bounds>>& flashes, double after_ms);
  void measure_delay(std::size_t projector, ProjectorTiming& timing, std::vector<Fault>& faults);
  [[nodiscard]] double refresh(std::size_t projector) const {
    const double stated = screen_.refresh_hz(projector);
    return stated > 0 ? stated : ProjectorScreen::kUsualRefreshHz;
  }

  LiveCameras& cameras_;
  ProjectorScreen& screen_;
  const ProjectorTestOptions& options_;
  bool software_;
  Random random_{1};
};

std::vector<TimedFrame> Tester::pictures_after(double ms) {
  return cameras_.taken_since(host_now_ns() + ns(ms), options_.patience_s);
}

std::vector<cv::Mat> Tester::settled_pictures() {
  std::vector<cv::Mat> pictures;
  for (const TimedFrame& frame : pictures_after(kLongestMs))
    pictures.push_back(frame.frame ? coarse_picture(frame.frame->image) : cv::Mat());
  return pictures;
}

void Tester::look(std::size_t projector, ProjectorTiming& timing) {
  screen_.show_all({});
  const auto black = settled_pictures();
  screen_.show(projector, {Kind::kWhite, 0, {}});
  const auto white = settled_pictures();
  timing.views.resize(black.size());
  for (std::size_t c = 0; c < black.size(); ++c)
    if (!black[c].empty() && !white[c].empty()) timing.views[c] = lit_view(white[c], black[c]);
}

void Tester::judge_flicker(std::size_t projector, ProjectorTiming& timing,
                           std::vector<Fault>& faults) {
  std::vector<std::vector<double>> levels(timing.views.size());
  for (int k = 0; k < options_.still_pictures; ++k) {
    // Triggered at any phase of the refresh.
    const auto frames = pictures_after(software_ ? random_.uniform(0, 40) : 0);
    for (std::size_t c = 0; c < frames.size(); ++c)
      if (frames[c].frame && timing.views[c].is_seen())
        levels[c].push_back(level_of(coarse_picture(frames[c].frame->image), timing.views[c]));
  }
  std::size_t worst = 0;
  for (std::size_t c = 0; c < levels.size(); ++c) {
    if (levels[c].size() < 2) continue;
    const auto [low, high] = std::minmax_element(levels[c].begin(), levels[c].end());
    double sum = 0;
    for (const double level : levels[c]) sum += level;
    const double share = (*high - *low) * static_cast<double>(levels[c].size()) / sum;
    if (share <= timing.flicker) continue;
    timing.flicker = share;
    worst = c;
  }
  if (timing.flicker <= kSteadyLight) return;
  const double period = 1000 / refresh(projector);
  faults.push_back(
      {"flicker", screen_.projectors()[projector].name,
       "its white changes by " + percent_text(timing.flicker) + " from picture to picture in " +
           cameras_.group().name(worst),
       "set exposures to a whole multiple of its period: " + formatted(period, "%.2f, ") +
           formatted(2 * period, "%.2f or ") + formatted(3 * period, "%.2f ms")});
}

void Tester::flash(std::size_t projector, bool white, const ProjectorTiming& timing,
                   std::vector<std::vector<Bounds>>& flashes) {
  const double rate = cameras_.group().settings(0).rate_hz.value_or(10);
  // Flashes fall anywhere between two pictures.
  std::this_thread::sleep_for(std::chrono::nanoseconds(ns(random_.uniform(0, 1000 / rate))));
  const std::int64_t shown = screen_.show(projector, {white ? Kind::kWhite : Kind::kBlack, 0, {}});
  std::vector<Bounds> bounds(flashes.size());
  std::vector<char> done(bounds.size());
  std::vector<std::int64_t> seen_until(bounds.size(), shown);
  const std::int64_t until = shown + ns(1000 * options_.patience_s);
  while (host_now_ns() < until) {
    bool all = true;
    for (std::size_t c = 0; c < bounds.size(); ++c) {
      if (!timing.views[c].is_seen() || done[c] != 0) continue;
      all = false;
      const TimedFrame latest = cameras_.latest(c);
      if (!latest.frame || latest.time_ns <= seen_until[c]) continue;
      seen_until[c] = latest.time_ns;
      const double level = level_of(coarse_picture(latest.frame->image), timing.views[c]);
      const double after_ms = static_cast<double>(latest.time_ns - shown) / 1e6;
      if ((white ? level : 1 - level) < kAllLight) {
        bounds[c].least = std::max(bounds[c].least, after_ms);
      } else {
        bounds[c].most = after_ms;
        flashes[c].push_back(bounds[c]);
        done[c] = 1;
      }
    }
    if (all) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

bool Tester::flash_triggered(std::size_t projector, bool white, const ProjectorTiming& timing,
                             std::vector<std::vector<Bounds>>& flashes, double after_ms) {
  const std::int64_t shown = screen_.show(projector, {white ? Kind::kWhite : Kind::kBlack, 0, {}});
  std::this_thread::sleep_for(
      std::chrono::nanoseconds(std::max<std::int64_t>(0, shown + ns(after_ms) - host_now_ns())));
  const double triggered_ms = static_cast<double>(host_now_ns() - shown) / 1e6;
  const auto frames = cameras_.trigger(options_.patience_s);
  bool there = true;
  for (std::size_t c = 0; c < flashes.size(); ++c) {
    if (!timing.views[c].is_seen() || !frames[c].frame) continue;
    const double level = level_of(coarse_picture(frames[c].frame->image), timing.views[c]);
    const bool late = (white ? level : 1 - level) < kAllLight;
    if (late)
      flashes[c].push_back({triggered_ms, std::numeric_limits<double>::infinity()});
    else
      flashes[c].push_back({0, triggered_ms});
    there = there && !late;
  }
  // What is shown now has to be all there before it changes again.
  std::this_thread::sleep_for(
      std::chrono::nanoseconds(std::max<std::int64_t>(0, shown + ns(kLongestMs) - host_now_ns())));
  return there;
}

void Tester::measure_delay(std::size_t projector, ProjectorTiming& timing,
                           std::vector<Fault>& faults) {
  std::vector<std::vector<Bounds>> flashes(timing.views.size());
  bool white = true;  // as it is now
  double low = 0;
  double high = kLongestMs;
  for (int k = 0; k < (software_ ? kSteps : 2 * options_.flashes); ++k) {
    white = !white;
    const double middle = 0.5 * (low + high);
    if (!software_)
      flash(projector, white, timing, flashes);
    else
      (flash_triggered(projector, white, timing, flashes, middle) ? high : low) = middle;
  }
  const double period = 1000 / refresh(projector);
  double jitter = 0;
  for (const std::vector<Bounds>& own : flashes) {
    const Bounds usual = agreed(own);
    if (own.empty() || !std::isfinite(usual.most)) continue;
    timing.measured = true;
    timing.least_ms = std::max(timing.least_ms, usual.least);
    timing.most_ms = std::max(timing.most_ms, usual.most);
    std::size_t strays = 0;
    double farthest = 0;
    for (const Bounds& flash : own) {
      const double off = std::max(flash.least - usual.most, usual.least - flash.most);
      if (off <= period) continue;
      ++strays;
      farthest = std::max(farthest, off);
    }
    if (static_cast<double>(strays) > kFewStrays * static_cast<double>(own.size()))
      jitter = std::max(jitter, farthest);
  }
  timing.use_ms = timing.most_ms + jitter + period;
  if (jitter == 0) return;
  faults.push_back({"jitter", screen_.projectors()[projector].name,
                    "its delay changes by " + formatted(jitter, "%.0f ms") + " from flash to flash",
                    "switch off its picture processing; trigger the cameras by a wire"});
}

ProjectorTiming Tester::test(std::size_t projector, std::vector<Fault>& faults) {
  ProjectorTiming timing;
  look(projector, timing);
  const bool seen = std::any_of(timing.views.begin(), timing.views.end(),
                                [](const LitView& view) { return view.is_seen(); });
  if (!seen) {
    faults.push_back({"unseen", screen_.projectors()[projector].name,
                      "no camera sees any of its light",
                      "lamp on? lens cap? the right output? exposure long enough?"});
    return timing;
  }
  judge_flicker(projector, timing, faults);
  measure_delay(projector, timing, faults);
  screen_.show(projector, {});
  return timing;
}

/// Who is slower than the others, by frames.
void compare_delays(const ProjectorScreen& screen, ProjectorTestReport& report) {
  const ProjectorTiming* fastest = nullptr;
  std::size_t first = 0;
  const auto middle = [](const ProjectorTiming& t) { return 0.5 * (t.least_ms + t.most_ms); };
  for (std::size_t p = 0; p < report.projectors.size(); ++p) {
    const ProjectorTiming& timing = report.projectors[p];
    if (!timing.measured || (fastest != nullptr && middle(timing) >= middle(*fastest))) continue;
    fastest = &timing;
    first = p;
  }
  for (std::size_t p = 0; fastest != nullptr && p < report.projectors.size(); ++p) {
    ProjectorTiming& timing = report.projectors[p];
    if (!timing.measured) continue;
    const double refresh =
        screen.refresh_hz(p) > 0 ? screen.refresh_hz(p) : ProjectorScreen::kUsualRefreshHz;
    const double behind_ms = middle(timing) - middle(*fastest);
    timing.frames_behind = behind_ms * refresh / 1000;
    // Both are known between their bounds only.
    const double doubt_ms =
        0.5 * (timing.most_ms - timing.least_ms + fastest->most_ms - fastest->least_ms);
    if (behind_ms - doubt_ms < 500 / refresh) continue;
    report.faults.push_back(
        {"late", screen.projectors()[p].name,
         "its light comes " + formatted(behind_ms, "%.0f ms") + " (" +
             formatted(timing.frames_behind, "%.1f frames") + ") after that of " +
             screen.projectors()[first].name,
         "captures wait for it; to be faster, switch off its picture processing (\"game mode\")"});
  }
}

void judge_exposures(const LiveCameras& cameras, const ProjectorScreen& screen,
                     ProjectorTestReport& report) {
  const CameraGroup& group = cameras.group();
  for (std::size_t c = 0; c < group.size(); ++c) {
    const auto exposure = group.settings(c).exposure_us;
    const double refresh = screen.projectors().empty() ? 0 : screen.refresh_hz(0);
    if (exposure && refresh > 0) {
      const double periods = *exposure * refresh / 1e6;
      if (std::abs(periods - std::max(1.0, std::round(periods))) > kPeriodSlack)
        report.faults.push_back(
            {"exposure", group.name(c),
             "exposes " + formatted(*exposure / 1000, "%.2f ms") + ", " +
                 formatted(periods, "%.2f periods") + " of the projectors",
             "set a whole multiple: " +
                 formatted(std::max(1.0, std::round(periods)) * 1000 / refresh, "%.2f ms")});
    }
    double brightest = 0;
    double saturated = 0;
    bool sees = false;
    for (const ProjectorTiming& timing : report.projectors) {
      if (c >= timing.views.size() || !timing.views[c].is_seen()) continue;
      sees = true;
      brightest = std::max(brightest, timing.views[c].brightest);
      saturated = std::max(saturated, timing.views[c].saturated);
    }
    if (!sees)
      report.faults.push_back({"blind", group.name(c), "sees no projector's light",
                               "lens cap? exposure long enough? does it look at the object?"});
    else if (saturated > 0.01)
      report.faults.push_back(
          {"saturated", group.name(c),
           percent_text(saturated) + " of what one projector lights is at the end of its range",
           "half the exposure, close the iris, or less gain"});
    else if (brightest < 0.2)
      report.faults.push_back(
          {"dim", group.name(c),
           "the brightest white is " + percent_text(brightest) + " of its range",
           "longer exposure, open the iris, or more gain"});
  }
}

}  // namespace

ProjectorTestReport test_projectors(LiveCameras& cameras, ProjectorScreen& screen,
                                    const ProjectorTestOptions& options,
                                    const ProjectorTestWatch& watch) {
  ProjectorTestReport report;
  Tester tester(cameras, screen, options);
  const std::size_t count = screen.projectors().size();
  for (std::size_t p = 0; p < count; ++p) {
    if (watch &&
        !watch(screen.projectors()[p].name, static_cast<double>(p) / static_cast<double>(count)))
      break;
    report.projectors.push_back(tester.test(p, report.faults));
  }
  screen.show_all({});
  report.projectors.resize(count);
  compare_delays(screen, report);
  judge_exposures(cameras, screen, report);
  return report;
}

}  // namespace pencilscan
