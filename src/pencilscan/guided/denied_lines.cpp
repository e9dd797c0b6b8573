#include "pencilscan/guided/denied_lines.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pencilscan/core/stretches.h"

namespace pencilscan {
namespace {

using Eigen::Vector2f;

constexpr int kLines = 2;  // to either side

/// True where a colour that denies one line speaks against the other.
bool speaks_against(const CurveLabel& denied, const CurveLabel& label) {
  const int lines = std::abs(label.line - denied.line);
  return label.pattern == denied.pattern && lines > 0 && lines <= kLines;
}

/// True where a place lies beside a point of a line that is denied.
bool is_beside(const Vector2f& place, const CurvePoint& point, float spacing_px) {
  // Of the spacing; along a line, names change with the surface.
  constexpr float kAcross = 0.5F + kLines;
  constexpr float kAlong = 0.5F;
  const Vector2f way = place - point.position;
  const float along = way.x() * point.normal.y() - way.y() * point.normal.x();
  return std::abs(way.dot(point.normal)) < kAcross * spacing_px &&
         std::abs(along) < kAlong * spacing_px;
}

}  // namespace

void drop_beside_denied(const GridGraph& graph, std::span<const DeniedRun> denied,
                        std::vector<LabeledRun>& runs, std::vector<UndecidedRun>& undecided) {
  const std::vector<LabeledRun> all = std::exchange(runs, {});
  std::vector<char> stays;
  for (const LabeledRun& run : all) {
    const auto& points = graph.curves[static_cast<std::size_t>(run.curve)].points;
    stays.assign(static_cast<std::size_t>(run.end - run.begin), 1);
    for (const auto& [line, spacing_px] : denied) {
      if (!speaks_against(line.label, run.label)) continue;
      const auto& of_line = graph.curves[static_cast<std::size_t>(line.curve)].points;
      for (std::size_t i = 0; i < stays.size(); ++i) {
        const Vector2f& place = points[static_cast<std::size_t>(run.begin) + i].position;
        if (std::any_of(of_line.begin() + line.begin, of_line.begin() + line.end,
                        [&, spacing = spacing_px](const CurvePoint& p) {
                          return is_beside(place, p, spacing);
                        }))
          stays[i] = 0;
      }
    }
    for_each_stretch(stays, [&](int begin, int end) {
      const int first = run.begin + begin;
      const int last = run.begin + end;
      if (stays[static_cast<std::size_t>(begin)] != 0) {
        runs.push_back({run.curve, first, last, run.label});
      } else {
        add_undecided({run.curve, first, last, UndecidedReason::kContradicted}, undecided);
      }
    });
  }
}

}  // namespace pencilscan
