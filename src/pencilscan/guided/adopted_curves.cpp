#include "pencilscan/guided/adopted_curves.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pencilscan/core/stretches.h"

namespace pencilscan {
namespace {

/// Logarithm of how much likelier a guided name is right than wrong.
float certainty_of(const GuidedMatchingOptions& options) {
  return std::log(options.confidence / (1 - options.confidence));
}

}  // namespace

void CurveAdoption::confirm(std::span<const LabeledRun> tentative) {
  const auto decided = names_.decided_points();
  std::vector<LabeledRun> confirmed;
  std::vector<char> agrees;
  for (const LabeledRun& run : tentative) {
    if (run.label.confidence < static_cast<float>(options_.min_tentative)) continue;
    const Curve& curve = names_.curve(run.curve);
    const LineName name{run.label.pattern, run.label.line};
    agrees.clear();
    for (int i = run.begin; i < run.end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      agrees.push_back(decided[static_cast<std::size_t>(run.curve)][k] == 0 &&
                       names_.missing_places().lies_on(curve.points[k], name));
    }
    for_each_stretch(agrees, [&](int begin, int end) {
      if (agrees[static_cast<std::size_t>(begin)] != 0 && end - begin >= options_.min_points)
        confirmed.push_back(names_.run_of(run.curve, run.begin + begin, run.begin + end, name));
    });
  }
  names_.accept(std::move(confirmed));
}

/// True where the lines around support a name. On a dense surface the stretch's own colour may do
/// so instead: where all lines of a projector were missed, there are none around.
bool CurveAdoption::is_supported(const Curve& curve, const PointRange& piece, const LineName& name,
                                 float margin) const {
  const int length = piece.end - piece.begin;
  if (names_.has_dense() && margin > 0 && length >= options_.min_adopted) return true;
  const auto first = curve.points.begin() + piece.begin;
  const auto supported = std::count_if(first, first + length, [&](const CurvePoint& p) {
    return names_.fits(p, name, curve.family);
  });
  return 2 * supported > length;
}

/// True where the name of a piece agrees with those of its curve before and after it. Lines of the
/// object end at a floor or wall; a surface that is wrong by whole lines makes them go on along its
/// curves. Both names then say what colour the piece has.
bool CurveAdoption::agrees_along(int curve, const PointRange& piece, const LineName& name) const {
  constexpr float kJump = 6;  // of a curve to another line, as for the joint solution (joint.cpp)
  const std::vector<LabeledRun>& runs = names_.runs();
  const auto after = std::lower_bound(
      runs.begin(), runs.end(), std::pair(curve, piece.begin),
      [](const LabeledRun& r, const auto& at) { return std::pair(r.curve, r.begin) < at; });
  const auto has_other = [&](const LabeledRun& run, int at) {
    const LineName other{run.label.pattern, run.label.line};
    return !(other == name) && !names_.is_of_object(run, at) &&
           colors_.lead(names_.curve(curve), piece, name, other) < kJump - certainty_of(options_);
  };
  if (after != runs.end() && after->curve == curve && has_other(*after, after->begin)) return false;
  return after == runs.begin() || (after - 1)->curve != curve ||
         !has_other(*(after - 1), (after - 1)->end - 1);
}

/// Of a piece on one line, within what is undecided of its curve.
bool CurveAdoption::is_long_enough(const std::vector<char>& decided,
                                   const PointRange& piece) const {
  // Share of the undecided stretch that is most of it. Chosen; no fit of it is kept.
  constexpr double kMost = 0.8;
  const int n = static_cast<int>(decided.size());
  auto [begin, end] = piece;
  const int length = end - begin;
  // A dense surface says as much for a piece as for a line that was not found at all.
  if (length >= (names_.has_dense() ? options_.min_points : options_.min_adopted)) return true;
  while (begin > 0 && decided[static_cast<std::size_t>(begin - 1)] == 0) --begin;
  while (end < n && decided[static_cast<std::size_t>(end)] == 0) ++end;
  return length >= options_.min_whole && length >= kMost * (end - begin);
}

/// Pieces of a curve on which one line is predicted are that line, or another one, together.
void CurveAdoption::adopt_pieces(int curve, const std::vector<char>& decided,
                                 const NamedPieces& of_name, std::span<const float> spacings,
                                 std::vector<LabeledRun>& adopted) {
  const Curve& of_pieces = names_.curve(curve);
  const auto& [name, pieces] = of_name;
  // A colour denies a name if it says more against it than a guided name is certain. A surface that
  // is not there predicts lines too: their places fit, their colours do not.
  const float certainty = certainty_of(options_);
  const auto denies = [&](float margin, int points) {
    return margin < -certainty && names_.has_dense() && points >= options_.min_adopted;
  };
  const float of_all = colors_.margin(of_pieces, pieces, name);
  const bool are_denied = denies(of_all, points_of(pieces));
  for (const PointRange& piece : pieces) {
    const auto [begin, end] = piece;
    const float own = pieces.size() == 1 ? of_all : colors_.margin(of_pieces, {piece}, name);
    const float margin = names_.has_dense() ? std::min(own, of_all) : own;
    if (are_denied || denies(own, end - begin))
      denied_.push_back({names_.run_of(curve, begin, end, name),
                         spacings[static_cast<std::size_t>((begin + end) / 2)]});
    if (margin > -certainty && is_long_enough(decided, piece) && agrees_along(curve, piece, name) &&
        is_supported(of_pieces, piece, name, margin))
      adopted.push_back(names_.run_of(curve, begin, end, name));
  }
}

void CurveAdoption::adopt() {
  const auto decided = names_.decided_points();
  std::vector<LabeledRun> adopted;
  std::vector<std::optional<LineName>> on_line;
  std::vector<float> spacings;
  denied_.clear();
  for (std::size_t c = 0; c < decided.size(); ++c) {
    const Curve& curve = names_.curve(static_cast<int>(c));
    on_line.assign(curve.points.size(), std::nullopt);
    spacings.assign(curve.points.size(), 0.F);
    for (std::size_t i = 0; i < on_line.size(); ++i) {
      if (decided[c][i] != 0) continue;
      const auto line = names_.missing_places().line_at(curve.points[i], curve.family);
      if (!line) continue;
      on_line[i] = line->name;
      spacings[i] = line->spacing_px;
    }
    for (const NamedPieces& of_name : pieces_of_names(on_line))
      adopt_pieces(static_cast<int>(c), decided[c], of_name, spacings, adopted);
  }
  names_.accept(std::move(adopted));
}

}  // namespace pencilscan
