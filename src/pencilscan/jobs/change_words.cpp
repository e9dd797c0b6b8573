#include "pencilscan/jobs/change_words.h"

#include <cmath>

#include "pencilscan/core/formatted.h"

namespace pencilscan {

std::string in_words(double value) {
  return formatted(value, std::abs(value) < 1000 ? "%.3g" : "%.0f");
}

bool is_of_light(const std::string& kind) { return kind == "height" || kind == "light"; }

std::string from_to(const std::string& kind, const Change& change) {
  if (is_of_light(kind)) return in_words(change.after / change.before) + " of that before";
  return in_words(change.after) + ", " + in_words(change.before) + " before";
}

std::string quantity(const std::string& kind) {
  if (kind == "labelled") return "the share of its curves that has a line is ";
  if (kind == "width") return "the width of its lines (px) is ";
  if (kind == "height") return "the light on lines that it takes in is ";
  if (kind == "light") return "the light on its lines is ";
  if (kind == "level") return "the mean light of its picture is ";
  if (kind == "projector") return "the number of points on its lines is ";
  if (kind == kShift) return "the shift with which its crossings meet (px) is ";
  return "its crossing lines miss each other by (px) ";
}

std::string usual_cause(const std::string& kind, const CauseClues& clues) {
  const auto [up, all, lines_too, is_spread] = clues;
  if (kind == "width")
    return up ? (all ? "motion, or a screen out of focus" : "out of focus") : "sharper";
  if (kind == "height")
    return up ? "aperture or exposure" : "aperture, exposure, or something before it";
  if (kind == "light" && is_spread)
    return "pictures are as bright as before: focus, or in a lit room the projectors' light";
  if (kind == "light" && all) return "the projectors' light, or the exposure of all cameras";
  if (kind == "light") return up ? "brighter" : "dimmer, or something before it";
  if (kind == "level" && lines_too) return "more light, the projectors' too";
  if (kind == "level") return up ? "light from elsewhere: a lamp" : "less light";
  if (kind == "labelled") return up ? "better again" : "lines are lost";
  if (kind == "projector") return up ? "on again" : "off, covered or turned away";
  return up ? "" : "agrees again";
}

}  // namespace pencilscan
