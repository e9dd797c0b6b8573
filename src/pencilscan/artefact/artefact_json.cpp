#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/artefact/artefact.h"

namespace pencilscan {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

/// "<name>_mm" and "<name>_trimmed_mm".
void add(Json& json, const std::string& name, const TwoFigures& figures) {
  json[name + "_mm"] = figures.all;
  json[name + "_trimmed_mm"] = figures.trimmed;
}

void add_points(Json& json, const ArtefactPoints& points, std::size_t left_out, std::size_t removed,
                double coverage) {
  json["points"] = points.points.size();
  json["coverage"] = coverage;
  json["removed_when_trimmed"] = removed;
  if (left_out > 0) json["left_out"] = left_out;
  if (points.outside_region > 0) json["outside_region"] = points.outside_region;
  if (points.not_finite > 0) json["not_finite"] = points.not_finite;
  if (points.without_face > 0) json["without_face"] = points.without_face;
}

void add_worst(Json& json, const ArtefactPoints& points, const std::vector<WorstPoint>& worst) {
  json["worst_points"] = Json::array();
  for (const WorstPoint& point : worst) {
    Json entry = {{"distance_mm", point.distance},
                  {"position", to_json(points.points[point.index])}};
    if (!points.sigma.empty()) entry["sigma_mm"] = points.sigma[point.index];
    if (!points.origins.empty()) {
      const PointOrigin& origin = points.origins[point.index];
      entry["camera"] = origin.camera;
      entry["projector"] = origin.projector;
      entry["line"] = origin.line;
      entry["pixel"] = {origin.u, origin.v};
      entry["confidence"] = origin.confidence;
    }
    json["worst_points"].push_back(std::move(entry));
  }
}

void add_z(Json& json, const std::optional<ZScores>& z) {
  if (!z) return;
  json["z"] = {{"count", z->count},      {"ray_misses", z->missed}, {"below_1", z->below_1},
               {"below_2", z->below_2},  {"below_3", z->below_3},   {"rms", z->rms},
               {"greatest", z->greatest}};
}

Json to_json(const BallFigures& ball) {
  Json json;
  add_points(json, ball.points, ball.left_out, ball.removed, ball.coverage);
  add(json, "PF", ball.form_mm);
  if (ball.size_mm) add(json, "PS", *ball.size_mm);
  json["diameter_mm"] = 2 * ball.sphere.radius;
  json["center"] = to_json(ball.sphere.center);
  add_z(json, ball.z);
  add_worst(json, ball.points, ball.worst);
  return json;
}

Json to_json(const BallBarFigures& bar) {
  Json json;
  if (bar.spacing_mm) add(json, "SD", *bar.spacing_mm);
  add(json, "distance", bar.distance_mm);
  if (bar.between > 0) json["points_between_the_balls"] = bar.between;
  json["balls"] = Json::array();
  for (const BallFigures& ball : bar.balls) json["balls"].push_back(to_json(ball));
  return json;
}

Json to_json(const PlateFigures& plate) {
  Json json;
  add_points(json, plate.points, plate.left_out, plate.removed, plate.coverage);
  add(json, "F", plate.flatness_mm);
  json["length_mm"] = plate.rectangle.length;
  json["width_mm"] = plate.rectangle.width;
  json["center"] = to_json(plate.rectangle.center);
  json["normal"] = to_json(plate.trimmed.normal);
  add_z(json, plate.z);
  add_worst(json, plate.points, plate.worst);
  return json;
}

/// The worst of all positions: the greatest figure by size, the least coverage and points.
class Worst {
 public:
  void take(const Json& position) {
    for (const auto& [key, value] : position.items()) {
      const bool figure = key.starts_with("PF") || key.starts_with("PS") || key.starts_with("SD") ||
                          key.starts_with("F_");
      if (figure) keep(key, value, [](double a, double b) { return std::abs(a) > std::abs(b); });
      if (key == "coverage" || key == "points") keep(key, value, std::less<>());
    }
    if (!position.contains("balls")) return;
    for (const Json& ball : position["balls"]) take(ball);
  }
  Json worst = Json::object();

 private:
  template <typename Worse>
  void keep(const std::string& key, const Json& value, const Worse& worse) {
    if (!worst.contains(key) || worse(value.get<double>(), worst[key].get<double>()))
      worst[key] = value;
  }
};

template <typename Positions>
void add_positions(Json& json, const Positions& positions, const ArtefactOptions& options) {
  for (const auto& position : positions) {
    Json entry;
    if constexpr (requires { position.balls; }) {
      entry["file"] = position.balls.front().points.source;
    } else {
      entry["file"] = position.points.source;
    }
    entry.update(to_json(position));
    const auto warnings = artefact_warnings(position, options);
    if (!warnings.empty()) entry["warnings"] = warnings;
    json["positions"].push_back(std::move(entry));
  }
}

}  // namespace

Json artefact_json(const ArtefactTest& test) {
  Json json;
  json["artefact"] = !test.spheres.empty()     ? "sphere"
                     : !test.ball_bars.empty() ? "ballbar"
                                               : "plate";
  json["manner"] = "after the manner of VDI/VDE 2634 part 3 and ISO 10360-13";
  json["calibrated"] = Json::object();
  const ArtefactOptions& options = test.options;
  if (options.diameter_mm) json["calibrated"]["diameter_mm"] = *options.diameter_mm;
  if (options.length_mm) json["calibrated"]["length_mm"] = *options.length_mm;
  if (options.plate_length_mm) json["calibrated"]["plate_length_mm"] = *options.plate_length_mm;
  if (options.plate_width_mm) json["calibrated"]["plate_width_mm"] = *options.plate_width_mm;
  json["trimmed_share"] = kTrimmedShare;
  json["positions"] = Json::array();
  add_positions(json, test.spheres, options);
  add_positions(json, test.ball_bars, options);
  add_positions(json, test.plates, options);
  for (const LackingPosition& position : test.lacking)
    json["without_result"].push_back({{"folder", position.folder.string()}, {"why", position.why}});
  Worst worst;
  for (const Json& position : json["positions"]) worst.take(position);
  json["worst"] = worst.worst;
  return json;
}

}  // namespace pencilscan
