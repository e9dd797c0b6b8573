// Do calibrations err as much as they say? Many runs on one rig and one set of surface points, each
// with noise of its own:
//   calibration_deviations [--runs 50] [--tracks 3000] [--noise 0.05] [--cameras 6]
//     [--known-cameras] [--one-lens]
// What is usual of lenses counts as a measurement (priors.h), so every run has lenses of its own,
// drawn from it; with --one-lens all runs have the same, and parameters that the data leave to the
// priors scatter less than their deviations say.
// Per kind of parameter: the scatter of the estimates over the runs (about their mean), the root
// mean square of the errors, and both over the standard deviation that is reported. Poses are
// compared in the gauge of least variance, as they are reported.

#include <CLI/CLI.hpp>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/bundle/priors.h"
#include "pencilscan/bundle/uncertainty.h"
#include "pencilscan/calibration/rig_frame.h"
#include "pencilscan/calibration/sample_input.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/rig/sample_ring.h"

namespace {

using namespace pencilscan;

constexpr Eigen::Index kPose = 6;

/// Small changes of all poses, as their deviations are reported: rotation in the device's frame,
/// shift over `distance`.
Eigen::VectorXd pose_changes(const std::vector<BundleDevice>& from,
                             const std::vector<BundleDevice>& to, double distance) {
  Eigen::VectorXd changes(kPose * static_cast<Eigen::Index>(from.size()));
  for (std::size_t d = 0; d < from.size(); ++d) {
    const Eigen::AngleAxisd turn(rotation_of(to[d]) * rotation_of(from[d]).transpose());
    const auto at = kPose * static_cast<Eigen::Index>(d);
    changes.segment<3>(at) = turn.angle() * turn.axis();
    for (Eigen::Index k = 0; k < 3; ++k)
      changes[at + 3 + k] = (to[d].pose[static_cast<std::size_t>(3 + k)] -
                             from[d].pose[static_cast<std::size_t>(3 + k)]) /
                            distance;
  }
  return changes;
}

/// How poses change under small similarities of the world, orthonormal columns.
Eigen::MatrixXd gauge_of(const std::vector<BundleDevice>& devices, double distance) {
  constexpr double kStep = 1e-6;
  Eigen::MatrixXd G(kPose * static_cast<Eigen::Index>(devices.size()), 7);
  for (Eigen::Index k = 0; k < 7; ++k) {
    BundleProblem moved;
    moved.devices = devices;
    RigidTransform step;
    if (k < 3) step.rotation = Eigen::AngleAxisd(kStep, Vec3::Unit(k)).toRotationMatrix();
    if (k >= 3 && k < 6) step.translation = kStep * distance * Vec3::Unit(k - 3);
    move_solution(k == 6 ? 1 + kStep : 1, step, moved);
    G.col(k) = pose_changes(devices, moved.devices, distance) / kStep;
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(G);
  return qr.householderQ() * Eigen::MatrixXd::Identity(G.rows(), 7);
}

/// The rig with lenses as unlike the usual as set_priors() expects.
Rig with_drawn_lenses(Rig rig, std::uint64_t seed) {
  Random random(seed);
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    const bool is_camera = d < rig.cameras.size();
    Device& device = device_at(rig, d);
    const double width = device.width;
    device.K(0, 2) = (width - 1) / 2 + random.normal(0, (is_camera ? 0.02 : 0.04) * width);
    if (is_camera) device.K(1, 2) = (device.height - 1) / 2.0 + random.normal(0, 0.02 * width);
    device.K(1, 1) = device.K(0, 0) * (1 + random.normal(0, is_camera ? 0.002 : 0.02));
    device.distortion[1] += random.normal(0, 0.5);
    for (const std::size_t i : {2, 3}) device.distortion[i] = random.normal(0, 0.002);
    BundleDevice drawn = bundle_device(device);
    set_priors({}, {}, is_camera, drawn);
    device.distortion[4] = random.normal(0, drawn.prior_sigma[kK3]);
  }
  return rig;
}

struct Run {
  std::vector<BundleDevice> truth;
  std::vector<BundleDevice> devices;
  Uncertainty sigma;
};

/// Estimates of one number over the runs.
struct Estimates {
  std::vector<double> errors;
  std::vector<double> sigmas;
};

/// Sums of squares of the estimates of one kind, each over its reported variance.
struct Kind {
  double sigma = 0;  ///< mean reported deviation
  double about_mean = 0;
  double about_truth = 0;
  double worst = 0;  ///< error over deviation
  std::size_t parameters = 0;
  std::size_t runs = 0;
};

void add(const Estimates& e, Kind& kind) {
  const auto n = static_cast<double>(e.errors.size());
  double mean = 0;
  for (const double x : e.errors) mean += x / n;
  ++kind.parameters;
  kind.runs = e.errors.size();
  for (std::size_t i = 0; i < e.errors.size(); ++i) {
    const double scatter = (e.errors[i] - mean) / e.sigmas[i];
    kind.sigma += e.sigmas[i] / n;
    kind.about_mean += scatter * scatter / (n - 1);
    const double z = e.errors[i] / e.sigmas[i];
    kind.about_truth += z * z / n;
    kind.worst = std::max(kind.worst, std::abs(z));
  }
}

void print(const char* name, const Kind& kind) {
  if (kind.parameters == 0) return;
  const auto n = static_cast<double>(kind.parameters);
  std::printf("%-10s %6zu %12.4g %16.3f %16.3f %10.2f\n", name, kind.parameters, kind.sigma / n,
              std::sqrt(n / kind.about_mean), std::sqrt(n / kind.about_truth), kind.worst);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Reported standard deviations against many calibrations");
  int runs = 50;
  int cameras = 6;
  bool known = false;
  bool one_lens = false;
  sample::TrackScene scene;
  scene.count = 3000;
  app.add_option("--runs", runs)->check(CLI::Range(2, 1000));
  app.add_option("--cameras", cameras)->check(CLI::Range(2, 6));
  app.add_option("--tracks", scene.count);
  app.add_option("--noise", scene.noise_px);
  app.add_flag("--known-cameras", known);
  app.add_flag("--one-lens", one_lens);
  CLI11_PARSE(app, argc, argv);

  const Rig ring = sample::ring(cameras, cameras);
  BundleProblem exact;
  for (std::size_t d = 0; d < device_count(ring); ++d) {
    exact.devices.push_back(bundle_device(device_at(ring, d)));
    exact.devices.back().present = true;
  }
  constexpr double kDistance = 1100;
  const Eigen::MatrixXd Q = gauge_of(exact.devices, kDistance);
  std::vector<Run> all(static_cast<std::size_t>(runs));
  parallel_for(all.size(), [&](std::size_t i) {
    sample::TrackScene noisy = scene;
    noisy.noise_seed = 100 + i;
    const Rig truth = one_lens ? ring : with_drawn_lenses(ring, 1000 + i);
    for (std::size_t d = 0; d < device_count(truth); ++d)
      all[i].truth.push_back(bundle_device(device_at(truth, d)));
    CalibrationInput input = sample::input_of(truth, sample::tracks_of(truth, noisy), known);
    for (std::size_t d = 0; d < device_count(truth); ++d) {  // a start: what is judged is the end
      device_at(input.rig, d).device_from_world = device_at(truth, d).device_from_world;
      input.known[d].pose = true;
    }
    input.distance.reset();
    const CalibrationResult result = calibrate(input);
    all[i].sigma = uncertainty(result.problem, result.adjustment);
    all[i].devices = result.problem.devices;
  });

  std::map<std::string, Kind> kinds;
  for (std::size_t d = 0; d < exact.devices.size(); ++d) {
    for (std::size_t k = 0; k < kIntrinsics; ++k) {
      Estimates e;
      for (const Run& run : all) {
        const double sigma = run.sigma.devices[d].inner[k];
        // Lenses are drawn from the priors: what is left to them errs as they say.
        if (sigma == 0 || (one_lens && run.sigma.devices[d].is_prior[k])) continue;
        e.errors.push_back(run.devices[d].inner[k] - run.truth[d].inner[k]);
        e.sigmas.push_back(sigma);
      }
      if (e.errors.size() == all.size()) add(e, kinds[kIntrinsicNames[k]]);
    }
  }
  std::vector<Eigen::VectorXd> changes;
  for (const Run& run : all) {
    Eigen::VectorXd c = pose_changes(exact.devices, run.devices, kDistance);
    // Twice: the first similarity may be large.
    c -= Q * (Q.transpose() * c);
    changes.push_back(c);
  }
  for (std::size_t d = 0; d < exact.devices.size(); ++d) {
    for (Eigen::Index k = 0; k < kPose; ++k) {
      Estimates e;
      for (std::size_t i = 0; i < all.size(); ++i) {
        const DeviceUncertainty& u = all[i].sigma.devices[d];
        const double unit = k < 3 ? 1 : kDistance;
        e.errors.push_back(unit * changes[i][kPose * static_cast<Eigen::Index>(d) + k]);
        e.sigmas.push_back(k < 3 ? u.rotation[k] : u.position[k - 3]);
      }
      add(e, kinds[k < 3 ? "rotation" : "position"]);
    }
  }
  std::printf("reported deviation, and over:\n%-10s %6s %12s %16s %16s %10s\n", "", "count", "mean",
              "scatter of runs", "error (RMS)", "worst z");
  for (const char* name : kIntrinsicNames) print(name, kinds[name]);
  print("rotation", kinds["rotation"]);
  print("position", kinds["position"]);
  return 0;
}
