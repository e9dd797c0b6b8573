#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "pencilscan/artefact/artefact.h"
#include "pencilscan/artefact/residual_map.h"
#include "pencilscan/artefact/sphere_fit.h"
#include "pencilscan/core/formatted.h"

namespace pencilscan {
namespace {

std::string number(double value, int decimals = 3) { return fixed(value, decimals); }
/// Signed, for errors of size and length.
std::string error(double value) { return (value >= 0 ? "+" : "") + number(value, 4); }
std::string percent(double share) { return number(100 * share, 1) + " %"; }

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '&':
        result += "&amp;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string row(const std::vector<std::string>& cells, const char* tag = "td") {
  std::string html = "<tr>";
  for (const std::string& cell : cells)
    html += std::string("<") + tag + ">" + cell + "</" + tag + ">";
  return html + "</tr>\n";
}

constexpr const char* kStyle = R"(<style>
:root{color-scheme:light dark;--ink:#1b2530;--paper:#fff;--soft:#f3f6f8;--rule:#d5dde3;--warn:#9a5b00;--warn-ground:#fff4e0}
@media(prefers-color-scheme:dark){:root{--ink:#dce4ea;--paper:#12181e;--soft:#1b242c;--rule:#36424c;--warn:#f2b34c;--warn-ground:#2b2314}}
body{font:15px/1.45 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:var(--ink);background:var(--paper)}
h1{margin-bottom:.2em}h2{margin-top:2em;overflow-wrap:anywhere}.wide{overflow-x:auto;margin:1em 0}
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}
td,th{border-bottom:1px solid var(--rule);padding:.25em .6em;text-align:right}
td:first-child,th:first-child{text-align:left;padding-left:0;min-width:7em;overflow-wrap:anywhere}tr.worst td{font-weight:600}
.plots{display:flex;flex-wrap:wrap;gap:1.5em}figure{margin:0}figcaption{font-size:13px;max-width:30em}
.warnings{list-style:none;margin:1em 0;padding:0;display:grid;gap:.5em}
.warnings li{border-left:4px solid var(--warn);border-radius:6px;background:var(--warn-ground);padding:.5em .8em;overflow-wrap:anywhere}
.warnings p{margin:.15em 0 0}
dt{font-weight:600}dd{margin:0 0 .5em 1em}svg{background:var(--soft);max-width:100%;height:auto}svg text{fill:var(--ink)}
</style>)";

/// Blue inwards, red outwards, pale in between.
std::string color_of(double share) {
  const double s = std::clamp(share, -1.0, 1.0);
  const std::array<double, 3> far =
      s < 0 ? std::array<double, 3>{33, 102, 172} : std::array<double, 3>{178, 24, 43};
  std::string text = "#";
  for (const double channel : far) {
    std::array<char, 8> digits{};
    const double value = 235 + (channel - 235) * std::abs(s);
    std::snprintf(digits.data(), digits.size(), "%02x", static_cast<unsigned>(value));
    text += digits.data();
  }
  return text;
}

std::string map_svg(const ResidualMap& map, double half_range, const std::string& caption) {
  constexpr int kCell = 5;
  const int width = kCell * map.columns, height = kCell * map.rows;
  std::string svg = "<figure><svg width='" + std::to_string(width) + "' height='" +
                    std::to_string(height) + "' viewBox='0 0 " + std::to_string(width) + " " +
                    std::to_string(height) + "' role='img' shape-rendering='crispEdges'>";
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.columns; ++x) {
      const auto& cell = map.cells[static_cast<std::size_t>(y * map.columns + x)];
      if (!cell) continue;
      svg += "<path fill='" + color_of(static_cast<double>(*cell) / half_range) + "' d='M" +
             std::to_string(kCell * x) + " " + std::to_string(kCell * y) + "h5v5h-5'/>";
    }
  }
  return svg + "</svg><figcaption>" + caption + "</figcaption></figure>";
}

std::string histogram_svg(const Histogram& histogram) {
  constexpr double kWidth = 320, kHeight = 160;
  std::size_t most = 1;
  for (const std::size_t count : histogram.counts) most = std::max(most, count);
  const double step = kWidth / static_cast<double>(histogram.counts.size());
  std::string svg = "<figure><svg width='320' height='180' viewBox='0 0 320 180' role='img'>";
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    const double h = kHeight * static_cast<double>(histogram.counts[i]) / static_cast<double>(most);
    svg += "<rect x='" + number(static_cast<double>(i) * step, 1) + "' y='" +
           number(kHeight - h, 1) + "' width='" + number(step - 1, 1) + "' height='" +
           number(h, 1) + "' fill='#5b83a5'/>";
  }
  const std::string end = formatted(histogram.half_range);
  svg += "<text x='2' y='176' font-size='11'>-" + end +
         " mm</text><text x='160' y='176' font-size='11' text-anchor='middle'>0</text>"
         "<text x='318' y='176' font-size='11' text-anchor='end'>" +
         end + " mm</text>";
  return svg +
         "</svg><figcaption>How many points deviate by how much; the outer bars also hold "
         "what lies beyond.</figcaption></figure>";
}

std::string z_text(const std::optional<ZScores>& z) {
  if (!z) return "";
  return "<p>Against their own sigma: " + percent(z->below_1) + " of " + std::to_string(z->count) +
         " points within one (ideal 68.3 %), " + percent(z->below_2) +
         " within two (95.4 %); root mean square of error / sigma " + number(z->rms, 2) +
         ", greatest " + number(z->greatest, 1) + ".</p>";
}

std::string worst_table(const ArtefactPoints& points, const std::vector<WorstPoint>& worst) {
  const bool ours = !points.origins.empty();
  std::string html = "<div class='wide'><table>";
  std::vector<std::string> heads{"worst points, mm", "deviation", "x", "y", "z"};
  if (!points.sigma.empty()) heads.emplace_back("sigma");
  if (ours) heads.insert(heads.end(), {"camera", "u", "v", "projector", "line", "confidence"});
  html += row(heads, "th");
  for (std::size_t i = 0; i < worst.size(); ++i) {
    const std::size_t at = worst[i].index;
    const Vec3& x = points.points[at];
    std::vector<std::string> cells{std::to_string(i + 1), number(worst[i].distance),
                                   number(x.x(), 2), number(x.y(), 2), number(x.z(), 2)};
    if (!points.sigma.empty()) cells.push_back(number(static_cast<double>(points.sigma[at])));
    if (ours) {
      const PointOrigin& o = points.origins[at];
      for (const double value :
           {static_cast<double>(o.camera), static_cast<double>(o.u), static_cast<double>(o.v),
            static_cast<double>(o.projector), static_cast<double>(o.line)})
        cells.push_back(number(value, 0));
      cells.push_back(number(static_cast<double>(o.confidence), 3));
    }
    html += row(cells);
  }
  return html + "</table></div>";
}

std::string ball_part(const BallFigures& ball) {
  // Scaled to what remains, so that one far point does not make all others pale.
  const double half = std::max(ball.form_mm.trimmed / 2, 1e-9);
  std::vector<double> deviations;
  for (const Vec3& point : ball.points.points)
    deviations.push_back(signed_distance(ball.trimmed, point));
  return "<div class='plots'>" +
         map_svg(map_of_sphere(ball.points.points, ball.trimmed), half,
                 "Deviation of greatest size per cell: longitude across, height up, equal areas. "
                 "Blue inwards, red outwards, full colour at " +
                     number(half) + " mm; without colour: no point.") +
         histogram_svg(histogram_of(deviations, 1.5 * half)) + "</div>" + z_text(ball.z) +
         worst_table(ball.points, ball.worst);
}

std::string plate_part(const PlateFigures& plate) {
  const double half = std::max(plate.flatness_mm.trimmed / 2, 1e-9);
  std::vector<double> deviations;
  for (const Vec3& point : plate.points.points)
    deviations.push_back(plate.trimmed.signed_distance(point));
  return "<div class='plots'>" +
         map_svg(map_of_plate(plate.points.points, plate.rectangle), half,
                 "Deviation of greatest size per cell; blue behind, red before the plane, full "
                 "colour at " +
                     number(half) + " mm; without colour: no point.") +
         histogram_svg(histogram_of(deviations, 1.5 * half)) + "</div>" + z_text(plate.z) +
         worst_table(plate.points, plate.worst);
}

std::string ball_cells_head() {
  return "<th>PF</th><th>PF, trimmed</th><th>PS</th><th>PS, trimmed</th>";
}

void add_ball_cells(std::vector<std::string>& cells, const BallFigures& ball) {
  cells.push_back(number(ball.form_mm.all, 4));
  cells.push_back(number(ball.form_mm.trimmed, 4));
  cells.push_back(ball.size_mm ? error(ball.size_mm->all) : "");
  cells.push_back(ball.size_mm ? error(ball.size_mm->trimmed) : "");
  cells.push_back(percent(ball.coverage));
  cells.push_back(std::to_string(ball.points.points.size()));
  cells.push_back(std::to_string(ball.left_out));
}

std::string positions_table(const ArtefactTest& test) {
  std::string html = "<div class='wide'><table>";
  const char* tail = "<th>coverage</th><th>points</th><th>left out</th></tr>\n";
  if (!test.plates.empty()) {
    html += std::string("<tr><th>position</th><th>F</th><th>F, trimmed</th>") + tail;
    for (const PlateFigures& plate : test.plates) {
      html += row({escaped(plate.points.source), number(plate.flatness_mm.all, 4),
                   number(plate.flatness_mm.trimmed, 4), percent(plate.coverage),
                   std::to_string(plate.points.points.size()), std::to_string(plate.left_out)});
    }
  } else if (!test.spheres.empty()) {
    html += "<tr><th>position</th>" + ball_cells_head() + tail;
    for (const BallFigures& ball : test.spheres) {
      std::vector<std::string> cells{escaped(ball.points.source)};
      add_ball_cells(cells, ball);
      html += row(cells);
    }
  } else {
    html += "<tr><th>position</th><th>SD</th><th>SD, trimmed</th><th>ball</th>" +
            ball_cells_head() + tail;
    for (const BallBarFigures& bar : test.ball_bars) {
      for (std::size_t b = 0; b < bar.balls.size(); ++b) {
        std::vector<std::string> cells{b == 0 ? escaped(bar.balls[b].points.source) : ""};
        cells.push_back(b == 0 && bar.spacing_mm ? error(bar.spacing_mm->all) : "");
        cells.push_back(b == 0 && bar.spacing_mm ? error(bar.spacing_mm->trimmed) : "");
        cells.push_back(std::to_string(b + 1));
        add_ball_cells(cells, bar.balls[b]);
        html += row(cells);
      }
    }
  }
  return html + "</table></div>";
}

/// ", and 1 without a result".
std::string with_lacking(std::size_t count) {
  return count == 0 ? "" : ", and " + std::to_string(count) + " without a result";
}

/// "Worst of all positions: PF 0.1234, PF trimmed 0.0456, ..."
std::string worst_line(const nlohmann::ordered_json& json) {
  std::string html = "<p><strong>Worst of all positions:</strong> ";
  bool first = true;
  for (const auto& [key, value] : json["worst"].items()) {
    std::string name = key.ends_with("_mm") ? key.substr(0, key.size() - 3) : key;
    std::replace(name.begin(), name.end(), '_', ' ');
    html += (first ? "" : ", ") + name + " " +
            (key == "points"     ? value.dump()
             : key == "coverage" ? percent(value.get<double>())
                                 : number(value.get<double>(), 4) + " mm");
    first = false;
  }
  return html + ".</p>";
}

/// One box: what it is about, and a sentence.
std::string warning_box(const std::string& about, const std::string& text) {
  return "<li><strong>" + escaped(about) + "</strong><p>" + escaped(text) + ".</p></li>\n";
}

std::string warning_boxes(const nlohmann::ordered_json& json,
                          const std::vector<LackingPosition>& lacking) {
  std::string html;
  for (const LackingPosition& position : lacking) {
    html += warning_box("No result: " + position.folder.string(),
                        position.why + "; no figure is of this position");
  }
  for (const auto& position : json["positions"]) {
    if (!position.contains("warnings")) continue;
    for (const auto& warning : position["warnings"]) {
      html += warning_box(position["file"].get<std::string>(), warning.get<std::string>());
    }
  }
  return html.empty() ? html : "<ul class='warnings'>" + html + "</ul>";
}

constexpr const char* kLegend = R"(<dl>
<dt>PF, probing error of form</dt><dd>Greatest minus least signed distance of the points to their least-squares sphere, its radius free.</dd>
<dt>PS, probing error of size</dt><dd>That sphere's diameter minus the calibrated one.</dd>
<dt>SD, sphere spacing</dt><dd>Distance of the centres of two spheres fitted with the calibrated radius, minus the calibrated distance.</dd>
<dt>F, flatness</dt><dd>Greatest minus least signed distance of the points to their least-squares plane.</dd>
<dt>trimmed</dt><dd>The same with the worst 3 per mille of the points removed and the rest fitted anew. Without this word nothing is removed.</dd>
<dt>coverage</dt><dd>Share of the artefact's surface that lies within 1 % of its diameter (a plate: of its diagonal) of a point. Who filters his points loses here.</dd>
<dt>left out</dt><dd>Points of a stem, a bar, the plate's other face or its border, as stated on the command line.</dd>
</dl>
)";

}  // namespace

std::string artefact_html(const ArtefactTest& test, const std::string& program) {
  const char* kind = !test.spheres.empty()     ? "sphere"
                     : !test.ball_bars.empty() ? "ball bar"
                                               : "plate";
  const std::size_t positions = test.spheres.size() + test.ball_bars.size() + test.plates.size();
  std::string html =
      "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' "
      "content='width=device-width'><title>Acceptance: " +
      std::string(kind) + "</title>" + kStyle + "<h1>Acceptance test: " + kind +
      "</h1><p>After the manner of VDI/VDE 2634 part 3 and ISO 10360-13 (their "
      "texts were not at hand). ";
  const ArtefactOptions& o = test.options;
  if (o.diameter_mm) html += "Calibrated diameter " + number(*o.diameter_mm, 4) + " mm. ";
  if (o.length_mm) html += "Calibrated distance " + number(*o.length_mm, 4) + " mm. ";
  html += std::to_string(positions) + (positions == 1 ? " position" : " positions") +
          with_lacking(test.lacking.size()) + (positions == 1 ? "." : "; the worst counts.") +
          " All figures in mm.</p>";
  const nlohmann::ordered_json json = artefact_json(test);
  html += warning_boxes(json, test.lacking) + positions_table(test) + worst_line(json) + kLegend;
  for (const BallFigures& ball : test.spheres)
    html += "<h2>" + escaped(ball.points.source) + "</h2>" + ball_part(ball);
  for (const BallBarFigures& bar : test.ball_bars) {
    html += "<h2>" + escaped(bar.balls.front().points.source) + "</h2>";
    for (std::size_t b = 0; b < bar.balls.size(); ++b)
      html += "<h3>Ball " + std::to_string(b + 1) + "</h3>" + ball_part(bar.balls[b]);
  }
  for (const PlateFigures& plate : test.plates)
    html += "<h2>" + escaped(plate.points.source) + "</h2>" + plate_part(plate);
  return html + "<p>" + escaped(program) + "</p></html>\n";
}

}  // namespace pencilscan
