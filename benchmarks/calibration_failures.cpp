// What goes wrong in captures, drawn many times: is it named rightly, or survived?
//   calibration_failures [--draws 5] [--tracks 4000] [--cameras 6] [--only swapped_folders]
//   [--verbose]
// Correspondences without images, of three captures, K of the cameras given. A draw decides which
// devices and captures are hit. Per draw: the verdict, whether what happened is what the findings
// say (and nothing else), and the median error of projections of points in the volume.

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "pencilscan/calibration/pair_matches.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/calibration/suspects.h"
#include "pencilscan/calibration/verdict.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/rig/sample_ring.h"

namespace {

using namespace pencilscan;

constexpr std::size_t kCaptures = 3;

struct Setting {
  Rig truth;
  sample::TrackScene scene;  ///< count: of all captures
};

struct Case {
  std::vector<Track> tracks;
  std::string expected;  ///< in a finding; empty: a good verdict
};

std::vector<Track> captures_of(const Setting& setting, const Rig& changed, std::size_t first) {
  std::vector<Track> all;
  for (std::size_t k = 0; k < kCaptures; ++k) {
    sample::TrackScene scene = setting.scene;
    scene.count /= static_cast<int>(kCaptures);
    scene.seed += 100 * (k + 1);
    scene.noise_seed += 100 * (k + 1);
    for (Track& track : sample::tracks_of(k < first ? setting.truth : changed, scene)) {
      track.capture = k;
      all.push_back(std::move(track));
    }
  }
  return all;
}

/// A device of the other kind than `d` that shares surfaces with it.
std::size_t partner_of(const Rig& rig, std::size_t d, Random& random) {
  const std::size_t cameras = rig.cameras.size();
  const auto flat = [&](std::size_t i) -> Vec3 {
    Vec3 c = device_at(rig, i).center();
    c.z() = 0;
    return c.normalized();
  };
  const double least = std::cos(100 * M_PI / 180);
  for (;;) {
    const bool of_cameras = d >= cameras;
    const auto n = static_cast<std::uint32_t>(of_cameras ? cameras : rig.projectors.size());
    const std::size_t other = random.below(n) + (of_cameras ? 0 : cameras);
    if (flat(d).dot(flat(other)) > least) return other;
  }
}

DevicePair ordered(std::size_t a, std::size_t b) { return std::minmax(a, b); }

std::string folder(const Rig& rig, const DevicePair& pair) {
  return device_at(rig, pair.second).name + "/" + device_at(rig, pair.first).name;
}

Case nothing_wrong(const Setting& setting, Random&) {
  return {captures_of(setting, setting.truth, kCaptures), ""};
}

Case outliers(const Setting& setting, Random&) {
  Setting wild = setting;
  wild.scene.outliers = 0.3;
  return {captures_of(wild, wild.truth, kCaptures), ""};
}

Case missing_projector(const Setting& setting, Random& random) {
  const std::size_t projector =
      setting.truth.cameras.size() +
      random.below(static_cast<std::uint32_t>(setting.truth.projectors.size()));
  const std::size_t a = partner_of(setting.truth, projector, random);
  std::size_t b = a;
  while (b == a) b = partner_of(setting.truth, projector, random);
  const auto all = captures_of(setting, setting.truth, kCaptures);
  return {without_pairs(all, {{{a, projector}, {}}, {{b, projector}, {}}}), ""};
}

/// From the second capture on one device is turned by 0.3 degrees and shifted by 4 mm.
Case moved_device(const Setting& setting, Random& random) {
  Setting moved = setting;
  const std::size_t d = random.below(static_cast<std::uint32_t>(device_count(setting.truth)));
  const auto direction = [&] {
    return Vec3(random.normal(), random.normal(), random.normal()).normalized();
  };
  RigidTransform& pose = device_at(moved.truth, d).device_from_world;
  const Vec3 center = device_at(moved.truth, d).center() + 4 * direction();
  pose.rotation =
      Eigen::AngleAxisd(0.3 * M_PI / 180, direction()).toRotationMatrix() * pose.rotation;
  pose.translation = -(pose.rotation * center);
  return {captures_of(setting, moved.truth, 1),
          std::string(d < setting.truth.cameras.size() ? "camera " : "projector ") +
              device_at(setting.truth, d).name + " has moved"};
}

/// In all captures; half of the time two of a projector's folders, else two of a camera's.
Case swapped_folders(const Setting& setting, Random& random) {
  const auto n = static_cast<std::uint32_t>(setting.truth.cameras.size());
  const std::size_t shared = random.below(2) == 0 ? random.below(n) : n + random.below(n);
  const std::size_t x = partner_of(setting.truth, shared, random);
  std::size_t y = x;
  while (y == x) y = partner_of(setting.truth, shared, random);
  const DevicePair a = ordered(shared, std::min(x, y));
  const DevicePair b = ordered(shared, std::max(x, y));
  std::vector<Track> mixed =
      sample::with_exchanged(captures_of(setting, setting.truth, kCaptures), a, b);
  return {mixed, folder(setting.truth, a) + " and " + folder(setting.truth, b) + " are swapped"};
}

struct Outcome {
  Case what;
  Verdict verdict;
  double error_px = 0;
  bool right = false;
};

Outcome outcome_of(const Setting& setting, Case what) {
  const CalibrationInput input = sample::input_of(setting.truth, what.tracks, true);
  const CalibrationResult result = calibrate(input);
  Outcome outcome;
  if (result.solved) {
    const Uncertainty sigma = uncertainty(result.problem, result.adjustment);
    outcome.verdict = judge(input, result, sigma, {});
    outcome.error_px = sample::projection_error(setting.truth, result.problem);
  } else {
    outcome.verdict.grade = Grade::kUnusable;
  }
  bool named = what.expected.empty() && outcome.verdict.grade == Grade::kGood;
  bool is_blamed = false;  // what is not to blame
  for (const Finding& finding : outcome.verdict.findings) {
    const bool accuses = finding.what.find(" are swapped") != std::string::npos ||
                         finding.what.find(" has moved") != std::string::npos;
    const bool is_it =
        !what.expected.empty() && finding.what.find(what.expected) != std::string::npos;
    named = named || is_it;
    is_blamed = is_blamed || (accuses && !is_it);
  }
  outcome.right = named && !is_blamed && outcome.verdict.grade != Grade::kUnusable;
  outcome.what = std::move(what);
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What goes wrong in captures: is it named?");
  int draws = 5;
  int cameras = 6;
  std::string only;
  bool verbose = false;
  Setting setting;
  setting.scene.count = 4000;
  setting.scene.noise_px = 0.05;
  app.add_option("--draws", draws)->check(CLI::Range(1, 1000));
  app.add_option("--cameras", cameras)->check(CLI::Range(3, 6));
  app.add_option("--tracks", setting.scene.count);
  app.add_option("--noise", setting.scene.noise_px);
  app.add_option("--only", only);
  app.add_flag("--verbose", verbose);
  CLI11_PARSE(app, argc, argv);
  setting.truth = sample::ring(cameras, cameras);

  using Failure = Case (*)(const Setting&, Random&);
  const std::array<std::pair<const char*, Failure>, 5> failures{
      {{"nothing_wrong", nothing_wrong},
       {"outliers", outliers},
       {"missing_projector", missing_projector},
       {"moved_device", moved_device},
       {"swapped_folders", swapped_folders}}};
  for (const auto& [name, failure] : failures) {
    if (!only.empty() && only != name) continue;
    std::vector<Outcome> outcomes(static_cast<std::size_t>(draws));
    parallel_for(outcomes.size(), [&](std::size_t i) {
      Random random(50 + i);
      Setting drawn = setting;
      drawn.scene.seed += 1000 * i;
      drawn.scene.noise_seed += 1000 * i;
      outcomes[i] = outcome_of(drawn, failure(drawn, random));
    });
    int right = 0;
    double worst = 0;
    for (const Outcome& outcome : outcomes) {
      right += outcome.right ? 1 : 0;
      worst = std::max(worst, outcome.error_px);
      if (outcome.right && !verbose) continue;
      std::printf("%s: %s, projections %.3f px off; expected: %s\n",
                  outcome.right ? "right" : "WRONG", to_string(outcome.verdict.grade).c_str(),
                  outcome.error_px,
                  outcome.what.expected.empty() ? "good" : outcome.what.expected.c_str());
      for (const Finding& finding : outcome.verdict.findings)
        std::printf("    %s: %s\n", to_string(finding.grade).c_str(), finding.what.c_str());
    }
    std::printf("%-18s right %d of %d, projections at worst %.3f px off (median over the volume)\n",
                name, right, draws, worst);
    std::fflush(stdout);
  }
  return 0;
}
