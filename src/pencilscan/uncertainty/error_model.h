#pragma once

namespace pencilscan {

// The error of a result, from few pieces of evidence and few parameters. experiments/error_model.py
// fits the parameters on its fit scenes and prints how often they hold on other ones;
// docs/depth.md derives the form. Lengths are in footprints (rig/rig.h).

/// What is known of how well one place of a surface was measured; lengths across the surface.
struct SurfaceEvidence {
  float predicted = 0;  ///< deviation of one camera's depths there, as their pictures let expect
  float scatter = 0;    ///< root mean square of the depths around about the place, bend taken out
  float bend = 0;       ///< how far the surface turns out of its plane from one depth to the next
  float one_sidedness = 0;  ///< length of the sum of the ways to the depths / sum of their lengths
  float cameras = 0;        ///< that measured it; 0: no evidence
};

/// What is known of a labelled point beside the surface; lengths along its camera ray.
struct PointEvidence {
  float own = 0;         ///< deviation that it had by itself
  float surface = 0;     ///< deviation of the surface that its ray meets; 0: it meets none
  float difference = 0;  ///< from that surface
  bool settled = false;  ///< it lies on the surface now
  float confidence = 0;  ///< of its label, as margins in the picture say
};

/// Standard deviation of a place across its surface. What the pictures let expect (of the mean over
/// cameras) and how far the depths scatter are two estimates of one deviation, each off by some
/// factor: the mean of their logarithms is better than both. Where depths lie on one side only, the
/// mean is one beyond their middle; and no quadric follows all of the bend.
[[nodiscard]] double surface_sigma(const SurfaceEvidence& evidence);

/// Standard deviation of a point along its ray. On lines the surface is known better than between
/// them; where point and surface contradict each other, either may be wrong.
[[nodiscard]] double point_sigma(const PointEvidence& evidence);

/// The probability that a label is right, where margins in the picture say `of_margin` and no dense
/// surface was asked. Margins take evidence for independent that is not, and know nothing of rare
/// errors that all pictures share: the share of wrong labels is a power of what they say, and never
/// below a small one.
[[nodiscard]] float confidence_on_lines(float of_margin);

/// The same where the dense surface was asked, which light of all pixels and cameras made: nearly
/// all wrong labels contradict it and are gone. Where a point does not lie on it, margins say
/// nothing.
[[nodiscard]] float confidence_on_surface(const PointEvidence& evidence);

}  // namespace pencilscan
