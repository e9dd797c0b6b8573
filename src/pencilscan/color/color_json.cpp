#include "pencilscan/color/color_json.h"

#include <nlohmann/json.hpp>

namespace pencilscan {
namespace {

using ColorJson = nlohmann::ordered_json;

ColorJson measured_json(const MeasuredNumber& number) {
  return {{"value", number.value}, {"sigma", number.sigma}};
}

ColorJson rows_json(const Mat3& matrix) {
  ColorJson rows = ColorJson::array();
  for (int row = 0; row < 3; ++row)
    rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2)});
  return rows;
}

ColorJson displacement_json(const ColorDisplacementEstimate& e) {
  return {{"shift_px", {e.value.shift_px.x(), e.value.shift_px.y()}},
          {"shift_sigma_px", {e.shift_sigma_px.x(), e.shift_sigma_px.y()}},
          {"scale", e.value.scale},
          {"scale_sigma", e.scale_sigma},
          {"determined", e.is_determined}};
}

}  // namespace

nlohmann::ordered_json color_json(const Rig& rig, const ColorCalibration& color) {
  ColorJson json;
  json["remarks"] = color.remarks;
  json["gamma"] = ColorJson::object();
  for (std::size_t c = 0; c < color.gamma.size(); ++c)
    if (color.gamma[c]) json["gamma"][rig.cameras[c].name] = measured_json(*color.gamma[c]);
  json["responses"] = ColorJson::array();
  for (const auto& [pair, response] : color.responses) {
    ColorJson entry{{"projector", rig.projectors[pair.second].name},
                    {"camera", rig.cameras[pair.first].name},
                    {"color_matrix", rows_json(response.matrix)},
                    {"color_matrix_sigma", rows_json(response.matrix_sigma)}};
    if (response.projector_gamma)
      entry["projector_gamma"] = measured_json(*response.projector_gamma);
    json["responses"].push_back(entry);
  }
  const LateralColor& lateral = color.lateral;
  if (lateral.devices.empty()) return json;
  json["registration"] = {{"written", color.displaces_lines},
                          {"samples", lateral.samples},
                          {"offset_rms_px", lateral.offset_rms_px},
                          {"explained_rms_px", lateral.explained_rms_px},
                          {"remaining_rms_px", lateral.remaining_rms_px},
                          {"devices", ColorJson::array()}};
  for (std::size_t d = 0; d < lateral.devices.size(); ++d)
    json["registration"]["devices"].push_back({{"name", device_at(rig, d).name},
                                               {"red", displacement_json(lateral.devices[d][0])},
                                               {"green", displacement_json(lateral.devices[d][1])},
                                               {"blue", displacement_json(lateral.devices[d][2])}});
  return json;
}

}  // namespace pencilscan
