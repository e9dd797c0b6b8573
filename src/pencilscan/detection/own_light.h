#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/detection/curve.h"
#include "pencilscan/detection/profile_fit.h"

namespace pencilscan {

/// sample_bilinear() at position + o normal for the offsets o = -7..8 px of a Profile.
void sample_across(const cv::Mat& image, const CurvePoint& point, Profile& profile);

/// Per point of a curve, 1 where the line has no light of its own: the curve was drawn across a gap
/// or beyond an end. Fits do not tell, since they average over more of the curve than a gap is
/// long.
///
/// The height of a point's own light is that of the line's profile, by least squares over level and
/// slope, in the mean of three profiles. Were the line there, it would have at least the share
/// `kept` of its height on the dimmer side, or of what is expected. A point is dark where no line
/// explains its own light 1000 times as well as that faintest one does: half-way between them for a
/// line far above its noise, nowhere for one within it. Of faintest lines one point in 1000 at most
/// is lost (a likelihood ratio exceeds k with a probability below 1 / k). Where the light of others
/// hides a place, a line keeps it.
///
/// `profiles`: of the image without all other curves. `all_light`: the image with them, or empty:
/// nothing hides a place. `expected`: heights, one per point, or empty.
[[nodiscard]] std::vector<char> dark_points(std::span<const CurvePoint> points,
                                            std::span<const Profile> profiles,
                                            const cv::Mat& all_light,
                                            std::span<const float> expected, float kept);

}  // namespace pencilscan
