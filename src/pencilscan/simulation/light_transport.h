#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "pencilscan/simulation/render.h"

namespace pencilscan {

/// What a projector shows, as it is shown: any picture, in linear light.
struct PanelPicture {
  cv::Mat light;  ///< CV_8UC3 RGB of the panel's size, 255 is white; empty: the projector is dark
  Vec3 gain = Vec3::Ones();  ///< factor on each colour: lamps that flicker, exposures
  double black_level = 0;    ///< light where it shows black, as a share of white, in [0, 1)
};

/// One camera's view of an object under projectors that show any pictures: rays are traced once,
/// then every picture is a sparse sum. The model is that of render.h with pixelated films: every
/// camera pixel gets the mean over its rays' footprints on the panel, whose pixels are square and
/// next to each other.
///
///   I(u) = albedo ambient + sum over projectors and panel pixels x of W(u, x) M light(x)
class LightTransport {
 public:
  /// InputError when the rig states a color_registration, which is not modelled here.
  LightTransport(const Rig& rig, std::size_t camera, const SimulatedObject& object,
                 const RenderOptions& options);

  /// Linear light, CV_32FC3 RGB, without sensor effects. One entry per projector of the rig.
  [[nodiscard]] cv::Mat render(std::span<const PanelPicture> panels) const;
  /// Its parts: what is there without projectors, and what one projector adds. CV_32FC3 RGB.
  [[nodiscard]] cv::Mat ambient() const;
  void add(std::size_t projector, const PanelPicture& panel, cv::Mat& image) const;
  /// Bytes that it takes.
  [[nodiscard]] std::size_t bytes() const;

 private:
  /// W of one projector: for every camera pixel the panel pixels that it sees, by rows.
  struct Table {
    cv::Size panel;
    Eigen::Matrix3f color;             ///< M
    std::vector<std::uint32_t> begin;  ///< per camera pixel, and the end
    std::vector<std::uint32_t> pixel;  ///< index in the panel, row by row
    std::vector<float> weight;
  };

  cv::Mat ambient_;  ///< CV_32FC1
  std::vector<Table> tables_;
};

}  // namespace pencilscan
