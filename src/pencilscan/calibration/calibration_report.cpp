#include "pencilscan/calibration/calibration_report.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "pencilscan/bundle/bundle_device.h"
#include "pencilscan/calibration/given_values.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/color/color_json.h"
#include "pencilscan/core/evenly_picked.h"

namespace pencilscan {
namespace {

using Json = nlohmann::ordered_json;

/// visit(view, error) for up to `most` views of a device, evenly chosen.
template <class Visit>
void for_some_residuals(const CalibrationReport& report, std::size_t device, std::size_t most,
                        Visit visit) {
  const std::size_t step = report.result.residuals[device].views / most + 1;
  std::size_t seen = 0;
  for_each_residual(report.result.problem,
                    [&](std::size_t, const TrackView& view, const Vec2& error) {
                      if (view.device == device && seen++ % step == 0) visit(view, error);
                    });
}

Json list(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

/// A few hundred [u, v, du, dv], px: where the device saw a point, and how far off it is predicted.
Json residuals_json(const CalibrationReport& report, std::size_t d) {
  constexpr std::size_t kMost = 400;
  const auto rounded = [](double px) { return std::round(1000 * px) / 1000; };
  Json residuals = Json::array();
  for_some_residuals(report, d, kMost, [&](const TrackView& view, const Vec2& error) {
    residuals.push_back(
        {rounded(view.pixel.x()), rounded(view.pixel.y()), rounded(error.x()), rounded(error.y())});
  });
  return residuals;
}

/// Some thousand of the surface points that were used, evenly picked, to 1 / 10,000 of their
/// spread.
Json points_json(const BundleProblem& problem) {
  constexpr std::size_t kMost = 3000;
  std::vector<Vec3> used;
  for (std::size_t i = 0; i < problem.points.size(); ++i)
    if (problem.used[i] != 0 && problem.points[i].allFinite()) used.push_back(problem.points[i]);
  Json points = Json::array();
  if (used.empty()) return points;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : used) mean += x / static_cast<double>(used.size());
  double square = 0;
  for (const Vec3& x : used) square += (x - mean).squaredNorm() / static_cast<double>(used.size());
  const double step = std::max(1e-4 * std::sqrt(square), 1e-9);
  const double per_unit = std::pow(10, -std::floor(std::log10(step)));
  for (const Vec3& x : evenly_picked(used, kMost))
    points.push_back(list((x * per_unit).array().round() / per_unit));
  return points;
}

/// What became of a given K; deviations are those of its tolerance, null where that is 0.
Json given_json(const CalibrationReport& report, std::size_t d) {
  const CalibrationResult& result = report.result;
  const char* const use = result.given[d] == GivenUse::kExact          ? "exact"
                          : result.given[d] == GivenUse::kContradicted ? "contradicted"
                                                                       : "within tolerance";
  Json json{{"use", use},
            {"focal_tolerance", result.tolerance.focal},
            {"center_tolerance_px", result.tolerance.center_px}};
  const auto moved =
      moved_deviations(device_at(report.input.rig, d), result.tolerance, result.problem.devices[d]);
  for (std::size_t i = 0; i < moved.size(); ++i)
    json["moved_deviations"][kIntrinsicNames[i]] = moved[i];
  return json;
}

Json device_json(const CalibrationReport& report, std::size_t d) {
  const CalibrationResult& result = report.result;
  Json json;
  json["name"] = device_at(report.input.rig, d).name;
  json["width"] = device_at(report.input.rig, d).width;
  json["height"] = device_at(report.input.rig, d).height;
  json["placed"] = result.placed[d] != 0;
  if (result.placed[d] == 0) return json;
  const BundleDevice& device = result.problem.devices[d];
  const DeviceUncertainty& u = report.uncertainty.devices[d];
  const DeviceResiduals& residuals = result.residuals[d];
  json["views"] = residuals.views;
  json["rms_px"] = residuals.rms_px;
  json["median_px"] = residuals.median_px;
  json["p95_px"] = residuals.p95_px;
  json["given_values_kept"] =
      result.given[d] == GivenUse::kExact || result.given[d] == GivenUse::kTolerance;
  if (result.given[d] != GivenUse::kNone) json["given"] = given_json(report, d);
  for (std::size_t i = 0; i < kIntrinsics; ++i) {
    Json parameter{{"value", device.inner[i]}, {"sigma", u.inner[i]}};
    if (u.is_prior[i]) parameter["held_at_prior"] = true;
    json["parameters"][kIntrinsicNames[i]] = parameter;
  }
  const RigidTransform& pose = device_at(result.rig, d).device_from_world;
  for (int row = 0; row < 3; ++row) json["R"].push_back(list(pose.rotation.row(row).transpose()));
  json["t"] = list(pose.translation);
  const Vec3 rotation_deg = u.rotation * 180 / std::numbers::pi;
  json["rotation_sigma_axes_deg"] = list(rotation_deg);
  json["rotation_sigma_deg"] = rotation_deg.norm() / std::sqrt(3.0);
  json["position_sigma"] = list(u.position);
  json["residuals"] = residuals_json(report, d);
  return json;
}

Json pairs_json(const CalibrationReport& report) {
  Json pairs = Json::array();
  for (const PairGeometry& pair : report.result.pairs) {
    pairs.push_back({{"projector", device_at(report.input.rig, pair.projector).name},
                     {"camera", device_at(report.input.rig, pair.camera).name},
                     {"correspondences", pair.matches},
                     {"inlier_share", pair.inlier_share()},
                     {"planar_share", pair.planar_share}});
  }
  return pairs;
}

Json decoding_json(const CalibrationReport& report) {
  Json decoding = Json::array();
  for (const DecodeSummary& summary : report.decoded) {
    Json entry{{"capture", summary.capture},
               {"projector", report.input.rig.projectors[summary.projector].name},
               {"camera", report.input.rig.cameras[summary.camera].name},
               {"valid_share_of_lit", summary.valid_share},
               {"correspondences", summary.samples}};
    for (std::size_t s = 0; s < kPixelStates; ++s)
      entry["pixels"][to_string(static_cast<PixelState>(s))] = summary.counts[s];
    if (!summary.wrong_order.empty()) entry["wrong_order"] = summary.wrong_order;
    decoding.push_back(entry);
  }
  return decoding;
}

/// What gives the scale, how well lengths in the volume are known by it, and the two devices whose
/// distance would give it best.
Json scale_json(const CalibrationReport& report) {
  Json json = Json::object();
  const auto put = [&](Json& into, const ScaleDeviation& scale) {
    for (const std::size_t d : scale.devices)
      into["devices"].push_back(device_at(report.input.rig, d).name);
    into["length_sigma_percent"] = 100 * scale.share;
  };
  if (const auto scale = scale_deviation(report.input, report.result, report.uncertainty)) {
    json["from"] = scale->from == ScaleDeviation::From::kDistance ? "known_distance"
                   : scale->from == ScaleDeviation::From::kBoard  ? "board"
                                                                  : "given_poses";
    put(json, *scale);
  }
  if (const auto best = best_distance(report.result, report.uncertainty))
    put(json["best_distance"], *best);
  return json;
}

Json loop_json(const CalibrationReport& report) {
  const LoopClosure& loop = report.loop;
  Json json{{"closed_ring", !loop.devices.empty()}};
  if (loop.devices.empty()) return json;
  for (const std::size_t d : loop.devices)
    json["devices"].push_back(device_at(report.input.rig, d).name);
  json["rotation_deg"] = loop.rotation_rad * 180 / std::numbers::pi;
  json["scale"] = loop.scale;
  json["gap"] = loop.gap;
  json["gap_px"] = loop.gap_px;
  return json;
}

}  // namespace

nlohmann::ordered_json calibration_json(const CalibrationReport& report) {
  const CalibrationResult& result = report.result;
  Json json;
  json["format"] = "calibration/1";
  json["verdict"] = to_string(report.verdict.grade);
  json["reasons"] = Json::array();
  for (const Finding& finding : report.verdict.findings)
    json["reasons"].push_back(
        {{"grade", to_string(finding.grade)}, {"what", finding.what}, {"advice", finding.advice}});
  json["unit"] = result.rig.unit_known ? "mm" : "unknown";
  json["rms_px"] = result.rms_px;
  json["held_out_rms_px"] = result.held_out_rms_px;
  json["tracks"] = std::count(result.problem.used.begin(), result.problem.used.end(), 1);
  json["views"] = result.views;
  json["views_dropped"] = result.views_dropped;
  if (!result.problem.board_views.empty())
    json["board"] = {{"corners", result.problem.board_views.size()},
                     {"rms_px", result.board_rms_px}};
  json["extra_sigma_px"] = result.adjustment.extra_sigma_px;
  json["shared_error_px"] = report.uncertainty.shared_px;
  // What a correspondence counted for, since neighbours share errors.
  json["track_weight"] = result.adjustment.track_weight;
  json["volume"] = {{"radius", report.uncertainty.volume_radius},
                    {"point_sigma_median", report.uncertainty.volume_median},
                    {"point_sigma_p95", report.uncertainty.volume_p95}};
  json["scale"] = scale_json(report);
  json["loop"] = loop_json(report);
  json["scene_moves"] = Json::array();
  for (const SceneMove& move : result.scene_moves)
    json["scene_moves"].push_back(
        {{"capture", move.capture + 1},
         {"between",
          {device_at(report.input.rig, move.a).name, device_at(report.input.rig, move.b).name}},
         {"shift", move.shift},
         {"deviations", move.deviations}});
  json["color"] = color_json(report.input.rig, report.color);
  json["devices"] = Json::array();
  for (std::size_t d = 0; d < result.placed.size(); ++d)
    json["devices"].push_back(device_json(report, d));
  json["points"] = points_json(result.problem);
  json["pairs"] = pairs_json(report);
  json["decoding"] = decoding_json(report);
  return json;
}

}  // namespace pencilscan
