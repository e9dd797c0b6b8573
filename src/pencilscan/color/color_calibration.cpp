#include "pencilscan/color/color_calibration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/linear_light.h"
#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

/// Pixels with a code that a pair needs for its colours to count.
constexpr std::size_t kLeastDecoded = 3000;
/// A gamma is another one than stated beyond this, or beyond four deviations.
constexpr double kGammaSlack = 0.08;
/// Displacements that move lines by less (root mean square, panel px) are not worth their noise.
constexpr double kLeastDisplacement = 0.02;

cv::Mat channel(const cv::Mat& image, int c) {
  cv::Mat result;
  cv::extractChannel(image, result, c);
  return result;
}

/// One row of the unmixing matrix applied to a stack of colour images.
GrayStack unmixed_stack(const GrayStack& stack, const Mat3& projector_from_camera,
                        Eigen::Index row) {
  cv::Matx13f weights;
  for (int c = 0; c < 3; ++c) weights(0, c) = static_cast<float>(projector_from_camera(row, c));
  const auto mix = [&](const cv::Mat& image) {
    cv::Mat result;
    cv::transform(image, result, weights);
    return result;
  };
  GrayStack result = stack;
  result.white = mix(stack.white);
  result.black = mix(stack.black);
  for (auto& axis : result.difference)
    for (cv::Mat& image : axis) image = mix(image);
  return result;
}

/// Patterns whose edges are many and sharp, each with its inverse; green, of grey the same.
std::optional<MeasuredNumber> measure_gamma(const CapturePair& pair, const Rig& rig) {
  if (!pair.inverses) return std::nullopt;
  const Camera& camera = rig.cameras[pair.camera];
  const Projector& projector = rig.projectors[pair.projector];
  const auto image = [&](std::size_t i) {
    return channel(read_color_image(pair, pair.files[i], camera), 1);
  };
  const auto sequence = gray_code_sequence(projector.width, projector.height);
  std::vector<std::pair<cv::Mat, cv::Mat>> patterns;
  for (std::size_t i = 2; i < sequence.size(); i += 2)
    if (sequence[i].bit == 2 || sequence[i].bit == 3) patterns.emplace_back(image(i), image(i + 1));
  return camera_gamma(image(0), image(1), patterns);
}

std::string pair_name(const Rig& rig, std::size_t camera, std::size_t projector) {
  return rig.projectors[projector].name + "/" + rig.cameras[camera].name;
}

Mat3 mean_matrix(const ColorCalibration& color, std::size_t camera) {
  Mat3 sum = Mat3::Zero();
  double count = 0;
  for (const auto& [pair, response] : color.responses) {
    if (pair.first != camera) continue;
    sum += response.matrix;
    ++count;
  }
  return sum / count;
}

}  // namespace

double ColorCollector::gamma_of(std::size_t camera,
                                const std::optional<MeasuredNumber>& measured) const {
  const double stated = rig_.cameras[camera].gamma;
  if (!measured) return stated;
  const double slack = std::max(kGammaSlack, 4 * measured->sigma);
  return std::abs(measured->value - stated) > slack ? measured->value : stated;
}

void ColorCollector::measure_channels(const CapturePair& pair, const DecodedView& grey,
                                      PairColor& color) {
  const Camera& camera = rig_.cameras[pair.camera];
  const Projector& projector = rig_.projectors[pair.projector];
  const double gamma = gamma_of(pair.camera, color.gamma);
  const auto read = [&](const std::filesystem::path& path) {
    return linearized(read_color_image(pair, path, camera), gamma);
  };
  GrayStack stack = make_gray_stack(projector.width, projector.height, pair.inverses,
                                    [&](std::size_t i) { return read(pair.files[i]); });
  std::map<std::string, cv::Mat> solids;
  for (const auto& [name, path] : pair.solids) solids[name] = read(path);
  color.response = color_response(stack.white, stack.black, solids);
  const Mat3 camera_from_projector =
      color.response ? color.response->matrix : camera.color_matrix_for(projector.name);
  const Mat3 projector_from_camera = camera_from_projector.inverse();
  std::array<DecodedView, 3> channels;
  for (std::size_t k = 0; k < 3; ++k)
    channels[k] = decode_gray_stack(
        unmixed_stack(stack, projector_from_camera, static_cast<Eigen::Index>(k)));
  const auto samples = color_samples(pair.camera, pair.projector, grey, channels);
  samples_.insert(samples_.end(), samples.begin(), samples.end());
}

void ColorCollector::add(const CapturePair& pair, const DecodedView& grey) {
  if (grey.counts[static_cast<std::size_t>(PixelState::kValid)] < kLeastDecoded) return;
  const auto [at, is_new] = pairs_.try_emplace({pair.camera, pair.projector});
  if (!is_new) return;
  PairColor& color = at->second;
  color.gamma = measure_gamma(pair, rig_);
  const cv::Mat white = read_color_image(pair, pair.files.front(), rig_.cameras[pair.camera]);
  color.in_color = cv::countNonZero(channel(white, 0) != channel(white, 1)) > 0;
  if (color.in_color) measure_channels(pair, grey, color);
}

void ColorCollector::combine_gammas(ColorCalibration& result) const {
  result.gamma.resize(rig_.cameras.size());
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    std::vector<double> values, sigmas, distances;
    for (const auto& [pair, color] : pairs_) {
      if (pair.first != c || !color.gamma) continue;
      values.push_back(color.gamma->value);
      sigmas.push_back(color.gamma->sigma);
    }
    if (values.empty()) continue;
    const double middle = upper_median(values);
    for (const double v : values) distances.push_back(std::abs(v - middle));
    // What differs between projectors is no property of the camera.
    const double spread = kDeviationPerMedian * upper_median(distances);
    result.gamma[c] = MeasuredNumber{middle, std::max(upper_median(sigmas), spread)};
  }
}

void ColorCollector::remark_on(ColorCalibration& result) const {
  if (pairs_.empty()) return;  // no pair was decoded
  const auto say = [&](std::string remark) { result.remarks.push_back(std::move(remark)); };
  const bool in_color = std::any_of(pairs_.begin(), pairs_.end(),
                                    [](const auto& pair) { return pair.second.in_color; });
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    const double stated = rig_.cameras[c].gamma;
    if (result.gamma[c] && gamma_of(c, result.gamma[c]) != stated)
      say("camera " + rig_.cameras[c].name + ": gamma " + fixed(result.gamma[c]->value, 2) +
          " +- " + fixed(result.gamma[c]->sigma, 2) + " instead of " + fixed(stated, 2));
  }
  for (std::size_t p = 0; p < rig_.projectors.size(); ++p) {
    std::vector<double> gammas;
    for (const auto& [pair, response] : result.responses)
      if (pair.second == p && response.projector_gamma)
        gammas.push_back(response.projector_gamma->value);
    constexpr double kClear = 0.1;
    const double gamma = gammas.empty() ? 1 : upper_median(gammas);
    if (std::abs(gamma - 1) > kClear)
      say("projector " + rig_.projectors[p].name + " shows value^" + fixed(gamma, 2) +
          " of its light: lines keep their places, their soft edges do not; set it to linear");
  }
  if (!in_color) {
    say("the captures are grey: lateral colour and crosstalk were not estimated (crosstalk is read "
        "off every frame)");
    return;
  }
  std::string without;
  for (const auto& [pair, color] : pairs_)
    if (color.in_color && !color.response)
      add_name(without, pair_name(rig_, pair.first, pair.second));
  if (!without.empty())
    say("no solid colours, or too few lit pixels (pattern --gray-code --solids): " + without +
        ". Crosstalk is read off every frame; lateral colour comes out smaller by about the share "
        "that colours leak");
  if (result.lateral.devices.empty()) {
    say("too little of the channels could be decoded to compare them");
    return;
  }
  say("colours displace lines by " + fixed(result.lateral.explained_rms_px, 3) +
      " panel px (root mean square): " +
      (result.displaces_lines ? "color_registration was written"
                              : "too little to matter, nothing was written"));
  std::string open;
  for (std::size_t d = 0; d < result.lateral.devices.size(); ++d) {
    const auto& colors = result.lateral.devices[d];
    if (std::any_of(colors.begin(), colors.end(),
                    [](const ColorDisplacementEstimate& e) { return !e.is_determined; }))
      add_name(open, device_at(rig_, d).name);
  }
  if (!open.empty())
    say("only how the colours of cameras and projectors add up is known, not the share of: " +
        open);
}

ColorCalibration ColorCollector::result() const {
  ColorCalibration result;
  combine_gammas(result);
  for (const auto& [pair, color] : pairs_)
    if (color.response) result.responses[pair] = *color.response;
  result.lateral = estimate_lateral_color(rig_, samples_);
  result.displaces_lines = result.lateral.explained_rms_px > kLeastDisplacement;
  remark_on(result);
  return result;
}

void set_colors(const ColorCalibration& color, Rig& rig) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    Camera& camera = rig.cameras[c];
    if (c < color.gamma.size() && color.gamma[c] &&
        std::abs(color.gamma[c]->value - camera.gamma) >
            std::max(kGammaSlack, 4 * color.gamma[c]->sigma))
      camera.gamma = color.gamma[c]->value;
    const bool is_measured = std::any_of(color.responses.begin(), color.responses.end(),
                                         [&](const auto& entry) { return entry.first.first == c; });
    if (!is_measured) continue;
    const Mat3 mean = mean_matrix(color, c);
    camera.color_matrix.reset();
    for (std::size_t p = 0; p < rig.projectors.size(); ++p) {
      const auto at = color.responses.find({c, p});
      camera.color_matrix_by_projector[rig.projectors[p].name] =
          at == color.responses.end() ? mean : at->second.matrix;
    }
  }
  if (!color.displaces_lines) return;
  for (std::size_t d = 0; d < color.lateral.devices.size(); ++d) {
    ColorRegistration registration;
    for (std::size_t k = 0; k < 3; ++k) registration.colors[k] = color.lateral.devices[d][k].value;
    if (d < rig.cameras.size())
      rig.cameras[d].color_registration = registration;
    else
      rig.projectors[d - rig.cameras.size()].color_registration = registration;
  }
}

}  // namespace pencilscan
