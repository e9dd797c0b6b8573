#include "pencilscan/guided/predicted_places.h"

#include <algorithm>
#include <vector>

#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {

PredictedPlaces::PredictedPlaces(const Rig& rig, const std::vector<ColorFamily>& families,
                                 const Camera& camera, const GuidedMatchingOptions& options)
    : rig_(rig), families_(families), options_(options), places_(camera.width, camera.height, 3) {}

void PredictedPlaces::set(std::span<const PredictedPoint> points) {
  places_.clear();
  for (const PredictedPoint& p : points) places_.add(p.position, p);
}

float PredictedPlaces::expected_width(const PredictedPoint& p) const {
  const LinePattern& pattern = rig_.pattern(p.pattern);
  return line_profile_width(p.spacing_px *
                            static_cast<float>(pattern.line_width_px / pattern.pitch_px));
}

std::optional<PredictedPlaces::LineAt> PredictedPlaces::line_at(const CurvePoint& point,
                                                                int family) const {
  constexpr float kClear = 0.8F;  // px that another line must be farther away
  // Of each line the point that is nearest across it; a line's farther points say nothing.
  struct Candidate {
    LineAt line;
    float across = 0;
    bool is_near = false;
  };
  std::vector<Candidate> candidates;
  aligned(point, [&](const PredictedPoint& p, float across) {
    if (across > 2 * options_.max_offset_px || family_of(families_, p.pattern) != family) return;
    const Candidate candidate{{name_of(p), p.spacing_px}, across, is_near(across, p)};
    const auto known = std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& c) {
      return c.line.name == candidate.line.name;
    });
    if (known == candidates.end()) {
      candidates.push_back(candidate);
    } else if (across < known->across) {
      *known = candidate;
    }
  });
  const auto nearer = [](const Candidate& a, const Candidate& b) { return a.across < b.across; };
  const auto best = std::min_element(candidates.begin(), candidates.end(), nearer);
  if (best == candidates.end() || !best->is_near) return std::nullopt;
  for (auto other = candidates.begin(); other != candidates.end(); ++other) {
    if (other != best && other->across < best->across + kClear) return std::nullopt;
  }
  return best->line;
}

bool PredictedPlaces::lies_on(const CurvePoint& point, const LineName& name) const {
  bool found = false;
  aligned(point, [&](const PredictedPoint& p, float across) {
    found = found || (name_of(p) == name && is_near(across, p));
  });
  return found;
}

}  // namespace pencilscan
