#include "pencilscan/depth/pilot_light.h"

#include <algorithm>
#include <compare>
#include <utility>

#include "pencilscan/core/median.h"

namespace pencilscan {
namespace {

constexpr std::size_t kEnoughPilots = 20;
constexpr int kPilotSteps = 5;

/// How badly the windows fit with a blur, the better the less. The median is of all windows: a blur
/// with which few of them fit shall not win by these few. Where half of them do not, more fits are
/// better.
struct BlurMisfit {
  float median = 0;
  std::size_t missing = 0;

  auto operator<=>(const BlurMisfit&) const = default;
};

BlurMisfit misfit_with(float blur, std::span<const PilotWindow> pilots, int half,
                       CameraLight& light) {
  constexpr float kNoFit = 1e9F;  // more than any window's
  light.blur_px = blur;
  WindowFitter fitter(light, half);
  std::vector<float> misfits;
  for (const auto& [pixel, start] : pilots)
    if (const auto fit = fitter.fit(pixel, start, kPilotSteps)) misfits.push_back(fit->misfit);
  const std::size_t missing = pilots.size() - misfits.size();
  misfits.resize(pilots.size(), kNoFit);
  return {misfits.empty() ? kNoFit : upper_median(std::move(misfits)), missing};
}

}  // namespace

float best_blur(std::span<const PilotWindow> pilots, int half, CameraLight light) {
  // A pixel alone blurs by 1 / sqrt(12). With 2.5 px, lines six pixels apart keep 3 % of their
  // contrast.
  constexpr float kLeast = 0.3F;
  constexpr float kMost = 2.5F;
  constexpr int kRounds = 4;  // of golden section: what is left of 2.2 px is 0.32 px
  constexpr float kGolden = 0.618034F;
  const auto misfit = [&](float blur) { return misfit_with(blur, pilots, half, light); };
  float low = kLeast;
  float high = kMost;
  float a = high - kGolden * (high - low);
  float b = low + kGolden * (high - low);
  BlurMisfit of_a = misfit(a);
  BlurMisfit of_b = misfit(b);
  for (int round = 0; round < kRounds; ++round) {
    if (of_a <= of_b) {
      high = b;
      b = a;
      of_b = of_a;
      a = high - kGolden * (high - low);
      of_a = misfit(a);
    } else {
      low = a;
      a = b;
      of_a = of_b;
      b = low + kGolden * (high - low);
      of_b = misfit(b);
    }
  }
  return 0.5F * (low + high);
}

std::optional<NoiseModel> noise_of(std::vector<NoiseSample> samples) {
  constexpr float kApart = 1e-4F;  // image values, a fortieth of a step of 8 bits: no slope
  constexpr float kOfDark = 0.2F;  // a slope that is too steep leaves so much of the dark's noise
  constexpr float kLeast = 1e-7F;  // a deviation of about one step of 12 bits
  if (samples.size() < kEnoughPilots) return std::nullopt;
  std::sort(samples.begin(), samples.end(), [](const NoiseSample& a, const NoiseSample& b) {
    return std::pair(a.mean, a.variance) < std::pair(b.mean, b.variance);
  });
  const auto middle = [&](std::size_t from, std::size_t to) {
    std::vector<float> variances;
    for (std::size_t k = from; k < to; ++k) variances.push_back(samples[k].variance);
    return NoiseSample{samples[(from + to) / 2].mean, upper_median(std::move(variances))};
  };
  const NoiseSample dark = middle(0, samples.size() / 2);
  const NoiseSample bright = middle(samples.size() / 2, samples.size());
  NoiseModel noise;
  if (bright.mean > dark.mean + kApart)
    noise.slope = std::max(0.F, (bright.variance - dark.variance) / (bright.mean - dark.mean));
  noise.offset =
      std::max({dark.variance - noise.slope * dark.mean, kOfDark * dark.variance, kLeast});
  return noise;
}

void measure_light(std::span<const PilotWindow> pilots, int half, CameraLight& light) {
  const float before = light.blur_px;
  light.blur_px = best_blur(pilots, half, light);
  std::vector<std::vector<NoiseSample>> samples(light.families.size());
  std::vector<float> residuals;
  WindowFitter fitter(light, half);
  for (const auto& [pixel, start] : pilots) {
    const auto fit = fitter.fit(pixel, start, kPilotSteps);
    if (!fit) continue;
    residuals.push_back(fit->relative_residual);
    for (std::size_t f = 0; f < samples.size(); ++f)
      samples[f].push_back({fitter.family_mean(f), fitter.family_variance(f)});
  }
  light.is_measured = residuals.size() >= kEnoughPilots;
  if (residuals.empty()) {
    light.blur_px = before;
    return;
  }
  light.usual_residual = upper_median(std::move(residuals));
  for (std::size_t f = 0; f < samples.size(); ++f)
    if (const auto noise = noise_of(std::move(samples[f]))) light.noise[f] = *noise;
}

}  // namespace pencilscan
