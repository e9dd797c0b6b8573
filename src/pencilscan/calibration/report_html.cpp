#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

#include "pencilscan/calibration/calibration_report.h"
#include "pencilscan/calibration/structure.h"

namespace pencilscan {
namespace {

std::string number(double value, int digits = 3) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

/// For coordinates in SVG.
std::string at(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '&')
      result += "&amp;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

std::string cell(const std::string& text) { return "<td>" + text + "</td>"; }
std::string head(const std::string& text) { return "<th>" + text + "</th>"; }

constexpr const char* kStyle = R"(<style>
body{font:15px/1.45 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#1b2530}
h1{margin-bottom:.2em}h2{margin-top:2em}table{border-collapse:collapse;font-size:13px}
td,th{border-bottom:1px solid #d5dde3;padding:.25em .6em;text-align:right}
td:first-child,th:first-child{text-align:left}
.good{background:#dff2e1}.doubtful{background:#fff0c9}.unusable{background:#fbd9d5}
.verdict{display:inline-block;padding:.4em 1em;border-radius:.4em;font-size:1.3em;font-weight:600}
li{margin:.5em 0;padding:.4em .8em;border-radius:.3em;list-style:none}ul{padding:0}
.advice{color:#46535e;display:block}.plots{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}
figcaption{font-size:13px}.held{color:#a14b00}.wide{overflow-x:auto}
</style>)";

std::string verdict_part(const CalibrationReport& report) {
  const std::string grade = to_string(report.verdict.grade);
  std::string html = "<p class='verdict " + grade + "'>" + grade + "</p><ul>";
  for (const Finding& finding : report.verdict.findings) {
    html += "<li class='" + to_string(finding.grade) + "'>" + escaped(finding.what);
    if (!finding.advice.empty())
      html += "<span class='advice'>What to do: " + escaped(finding.advice) + ".</span>";
    html += "</li>";
  }
  if (report.verdict.findings.empty()) html += "<li class='good'>Nothing to complain about.</li>";
  const CalibrationResult& r = report.result;
  const std::string unit = r.rig.unit_known ? " mm" : " units";
  html += "</ul><p>Reprojection error " + number(r.rms_px) + " px RMS over " +
          std::to_string(r.views) + " views (" + number(r.held_out_rms_px) +
          " px for correspondences held out); " + std::to_string(r.views_dropped) +
          " views dropped as outliers. A point of the working volume (radius " +
          number(report.uncertainty.volume_radius) + unit + ") is off by " +
          number(report.uncertainty.volume_median, 2) + unit +
          " (median of one standard deviation; 95th percentile " +
          number(report.uncertainty.volume_p95, 2) + unit + ") from the rig's errors alone.</p>";
  return html;
}

/// Mean residual per part of the image as arrows, single errors as dots.
std::string residual_plot(const CalibrationReport& report, std::size_t d,
                          const std::vector<TrendCell>& cells) {
  const Device& device = device_at(report.result.rig, d);
  constexpr double kWidth = 240;
  constexpr double kArrow = 200;  // plot px per image px
  const double scale = kWidth / device.width;
  const double height = device.height * scale;
  std::string svg = "<figure><svg width='240' height='" + at(height) +
                    "' role='img'><rect width='240' height='" + at(height) +
                    "' fill='#f3f6f8' stroke='#b8c4cc'/>";
  constexpr std::size_t kMostDots = 500;
  for_some_residuals(report, d, kMostDots, [&](const TrackView& view, const Vec2&) {
    svg += "<circle cx='" + at(view.pixel.x() * scale) + "' cy='" + at(view.pixel.y() * scale) +
           "' r='1' fill='#9fb3c1'/>";
  });
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].views < 10) continue;
    const double x = (static_cast<double>(i % 4) + 0.5) * kWidth / 4;
    const double y = (static_cast<double>(i / 4) + 0.5) * height / 4;
    svg += "<line x1='" + at(x) + "' y1='" + at(y) + "' x2='" + at(x + kArrow * cells[i].mean.x()) +
           "' y2='" + at(y + kArrow * cells[i].mean.y()) +
           "' stroke='#c03020' stroke-width='2'/><circle cx='" + at(x) + "' cy='" + at(y) +
           "' r='2' fill='#c03020'/>";
  }
  return svg + "</svg><figcaption>" + escaped(device.name) + ": RMS " +
         number(report.result.residuals[d].rms_px) + " px, 95 % below " +
         number(report.result.residuals[d].p95_px) + " px</figcaption></figure>";
}

/// Devices from above, with what they share.
std::string overlap_plot(const CalibrationReport& report) {
  const BundleProblem& problem = report.result.problem;
  constexpr double kSize = 420;
  double extent = 1e-9;
  for (std::size_t d = 0; d < problem.devices.size(); ++d)
    if (problem.devices[d].present)
      extent = std::max(extent, center_of(problem.devices[d]).head<2>().norm());
  const auto place = [&](std::size_t d) -> Vec2 {
    const Vec3 c = center_of(problem.devices[d]);
    return {kSize / 2 + 0.42 * kSize * c.x() / extent, kSize / 2 - 0.42 * kSize * c.y() / extent};
  };
  std::string svg = "<svg width='420' height='420' role='img'>";
  for (const PairGeometry& pair : report.result.pairs) {
    if (!problem.devices[pair.camera].present || !problem.devices[pair.projector].present) continue;
    const Vec2 a = place(pair.camera);
    const Vec2 b = place(pair.projector);
    const double width = 0.3 + std::log10(1 + static_cast<double>(pair.inliers)) / 1.5;
    const char* color = pair.inlier_share() < 0.7 ? "#c03020" : "#7aa0b8";
    svg += "<line x1='" + at(a.x()) + "' y1='" + at(a.y()) + "' x2='" + at(b.x()) + "' y2='" +
           at(b.y()) + "' stroke='" + color + "' stroke-width='" + at(width) + "'/>";
  }
  for (std::size_t d = 0; d < problem.devices.size(); ++d) {
    if (!problem.devices[d].present) continue;
    const Vec2 p = place(d);
    const bool is_camera = d < report.input.rig.cameras.size();
    svg += "<circle cx='" + at(p.x()) + "' cy='" + at(p.y()) + "' r='6' fill='" +
           std::string(is_camera ? "#205080" : "#d08020") + "'/><text x='" + at(p.x() + 8) +
           "' y='" + at(p.y() + 4) + "' font-size='12'>" +
           escaped(device_at(report.input.rig, d).name) + "</text>";
  }
  return svg + "</svg>";
}

std::string loop_part(const CalibrationReport& report) {
  const LoopClosure& loop = report.loop;
  if (loop.devices.empty())
    return "<p>The devices are no closed ring of neighbours that share correspondences, so there "
           "is no way round to come back on.</p>";
  std::string names;
  for (const std::size_t d : loop.devices)
    names += escaped(device_at(report.input.rig, d).name) + ", ";
  const std::string& first = device_at(report.input.rig, loop.devices.front()).name;
  return "<p>Once round the ring (" + names + "and back to " + escaped(first) +
         "), each step by the correspondences of its own two devices alone: points of the volume "
         "come back " +
         number(loop.gap, 2) + (report.result.rig.unit_known ? " mm" : " units") + " off, " +
         number(loop.gap_px, 2) + " px in " + escaped(first) + "; turned by " +
         number(loop.rotation_rad * 180 / std::numbers::pi, 2) + "&deg;, lengths by " +
         number(100 * (loop.scale - 1), 2) +
         " %. The adjustment of the whole rig spreads such gaps evenly; a large one says that "
         "steps contradict each other.</p>";
}

std::string parameters_part(const CalibrationReport& report) {
  std::string html = "<div class='wide'><table><tr>" + head("device");
  for (const char* name : kIntrinsicNames) html += head(name);
  html += head("rotation sd, deg") + head("position sd x, y, z") + "</tr>";
  for (std::size_t d = 0; d < report.result.placed.size(); ++d) {
    html += "<tr>" + cell(escaped(device_at(report.input.rig, d).name));
    if (report.result.placed[d] == 0) {
      html += "<td colspan='11'>not placed</td></tr>";
      continue;
    }
    const DeviceUncertainty& u = report.uncertainty.devices[d];
    for (std::size_t i = 0; i < kIntrinsics; ++i) {
      const double value = report.result.problem.devices[d].inner[i];
      const std::string text = number(value, i < kK1 ? 6 : 3) +
                               (u.inner[i] > 0 ? " &plusmn; " + number(u.inner[i], 2) : " (held)");
      html += u.is_prior[i] ? "<td class='held'>" + text + "*</td>" : cell(text);
    }
    html += cell(number(u.rotation.norm() / std::sqrt(3.0) * 180 / std::numbers::pi, 2)) +
            cell(number(u.position.x(), 2) + ", " + number(u.position.y(), 2) + ", " +
                 number(u.position.z(), 2)) +
            "</tr>";
  }
  return html +
         "</table></div><p>&plusmn; is one standard deviation; * the data say little: the "
         "value is what is plausible or was given. Positions are along the device's axes, "
         "of all the positions of the whole rig in the one that varies least.</p>";
}

std::string pairs_part(const CalibrationReport& report) {
  std::string html = "<div class='wide'><table><tr>" + head("pair") + head("correspondences") +
                     head("fit one geometry") + head("fit one plane") + "</tr>";
  for (const PairGeometry& pair : report.result.pairs) {
    html += "<tr>" +
            cell(escaped(device_at(report.input.rig, pair.projector).name + "/" +
                         device_at(report.input.rig, pair.camera).name)) +
            cell(std::to_string(pair.matches)) + cell(number(100 * pair.inlier_share()) + " %") +
            cell(number(100 * pair.planar_share) + " %") + "</tr>";
  }
  return html + "</table></div>";
}

std::string color_part(const CalibrationReport& report) {
  std::string html = "<ul>";
  for (const std::string& remark : report.color.remarks) html += "<li>" + escaped(remark) + "</li>";
  html += "</ul>";
  const auto& devices = report.color.lateral.devices;
  if (devices.empty()) return html;
  html += "<div class='wide'><table><tr>" + head("device") + head("red, px") + head("green, px") +
          head("blue, px") + "</tr>";
  for (std::size_t d = 0; d < devices.size(); ++d) {
    html += "<tr>" + cell(escaped(device_at(report.input.rig, d).name));
    for (const ColorDisplacementEstimate& e : devices[d])
      html += cell(number(e.value.shift_px.x(), 2) + ", " + number(e.value.shift_px.y(), 2) +
                   " &plusmn; " + number(e.shift_sigma_px.maxCoeff(), 1));
    html += "</tr>";
  }
  return html +
         "</table></div><p>Where each device has each colour in the middle of its image, against "
         "all colours together.</p>";
}

std::string decoding_part(const CalibrationReport& report) {
  std::string html = "<div class='wide'><table><tr>" + head("capture, pair");
  for (std::size_t s = 0; s < kPixelStates; ++s)
    html += head(to_string(static_cast<PixelState>(s)));
  html += head("of lit") + head("correspondences") + "</tr>";
  for (const DecodeSummary& summary : report.decoded) {
    html += "<tr>" + cell(std::to_string(summary.capture + 1) + ", " +
                          escaped(report.input.rig.projectors[summary.projector].name + "/" +
                                  report.input.rig.cameras[summary.camera].name));
    for (const std::size_t count : summary.counts) html += cell(std::to_string(count));
    html += cell(number(100 * summary.valid_share) + " %") + cell(std::to_string(summary.samples)) +
            "</tr>";
  }
  return html + "</table></div>";
}

}  // namespace

std::string calibration_html(const CalibrationReport& report) {
  std::string html =
      "<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'><title>Calibration</title>" +
      std::string(kStyle) + "</head><body><h1>Calibration</h1>" + verdict_part(report);
  if (report.result.solved) {
    html +=
        "<h2>Errors over the images</h2><p>Arrows: mean error in a part of the image, 200 times "
        "enlarged; a pattern in them means a wrong lens model or a moved device. Dots: where "
        "correspondences lie.</p><div class='plots'>";
    const auto trends = residual_trends(report.result);
    for (std::size_t d = 0; d < trends.size(); ++d)
      if (report.result.placed[d] != 0) html += residual_plot(report, d, trends[d]);
    html +=
        "</div><h2>The rig from above, and who sees what</h2><p>Lines: correspondences of a "
        "camera and a projector; red: many of them contradict each other.</p>" +
        overlap_plot(report) + loop_part(report) + "<h2>Parameters</h2>" + parameters_part(report);
  }
  html += "<h2>Colour</h2>" + color_part(report) + "<h2>Pairs</h2>" + pairs_part(report) +
          "<h2>Decoding, in pixels</h2>" + decoding_part(report);
  return html + "</body></html>\n";
}

}  // namespace pencilscan
