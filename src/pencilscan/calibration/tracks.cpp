#include "pencilscan/calibration/tracks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "pencilscan/core/check.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/gray/local_map.h"

namespace pencilscan {
namespace {

bool inside(const Vec2& pixel, const Vec2& size) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= size.x() - 0.5 &&
         pixel.y() <= size.y() - 0.5;
}

}  // namespace

TrackBuilder::TrackBuilder(const Rig& rig, const GrayTrackOptions& options)
    : options_(options), cameras_(rig.cameras.size()) {
  PENCILSCAN_CHECK(options.spacing_px >= 8);
  for (std::size_t d = 0; d < device_count(rig); ++d) {
    const Device& device = device_at(rig, d);
    columns_.push_back(device.width / options.spacing_px + 1);
    size_.emplace_back(device.width, device.height);
  }
}

void TrackBuilder::add(std::size_t capture, std::size_t camera, std::size_t projector,
                       const DecodedView& decoded) {
  add_camera_hubs(capture, camera, projector, decoded);
  add_projector_hubs(capture, camera, projector, decoded);
}

void TrackBuilder::add_camera_hubs(std::size_t capture, std::size_t camera, std::size_t projector,
                                   const DecodedView& decoded) {
  const int step = options_.spacing_px;
  const auto across = static_cast<std::size_t>(columns_[camera]);
  const std::size_t down = static_cast<std::size_t>(decoded.state.rows / step + 1);
  const std::size_t device = cameras_ + projector;
  std::vector<std::optional<Sample>> found(across * down);
  parallel_for(found.size(), [&](std::size_t i) {
    const int u = step / 2 + step * static_cast<int>(i % across);
    const int v = step / 2 + step * static_cast<int>(i / across);
    if (u >= decoded.state.cols || v >= decoded.state.rows) return;
    const auto map = LocalMap::fit(decoded, u, v);
    if (!map) return;
    const Vec2 pixel(u, v);
    const Vec2 panel = map->panel_from_camera(pixel);
    const double sigma =
        std::hypot(map->sigma_panel_px().norm() / std::sqrt(2.0), options_.least_sigma_px);
    if (sigma > options_.largest_sigma_px || !inside(panel, size_[device])) return;
    found[i] =
        Sample{capture, camera, static_cast<std::uint32_t>(i), pixel, {device, panel, sigma}};
  });
  for (auto& sample : found)
    if (sample) samples_.push_back(*std::move(sample));
}

void TrackBuilder::add_projector_hubs(std::size_t capture, std::size_t camera,
                                      std::size_t projector, const DecodedView& decoded) {
  const int step = options_.spacing_px;
  const std::size_t hub = cameras_ + projector;
  const auto across = static_cast<std::size_t>(columns_[hub]);
  const std::size_t down = static_cast<std::size_t>(size_[hub].y()) / options_.spacing_px + 1;
  // For every lattice point of the panel the camera pixel whose code is nearest.
  struct Nearest {
    int distance = 3;  ///< sum over both axes, panel px
    cv::Point pixel;
  };
  std::vector<Nearest> nearest(across * down);
  for (int v = 0; v < decoded.state.rows; ++v) {
    for (int u = 0; u < decoded.state.cols; ++u) {
      if (!decoded.valid(u, v)) continue;
      const int x = decoded.code[0](v, u);
      const int y = decoded.code[1](v, u);
      const int distance = std::abs(x % step - step / 2) + std::abs(y % step - step / 2);
      Nearest& best =
          nearest[static_cast<std::size_t>(y / step) * across + static_cast<std::size_t>(x / step)];
      if (distance < best.distance) best = {distance, {u, v}};
    }
  }
  std::vector<std::optional<Sample>> found(nearest.size());
  parallel_for(found.size(), [&](std::size_t i) {
    if (nearest[i].distance >= 3) return;
    const auto map = LocalMap::fit(decoded, nearest[i].pixel.x, nearest[i].pixel.y);
    if (!map) return;
    const Vec2 panel(step / 2 + step * static_cast<int>(i % across),
                     step / 2 + step * static_cast<int>(i / across));
    const auto pixel = map->camera_from_panel(panel, 4);
    if (!pixel || !inside(*pixel, size_[camera])) return;
    const double sigma = std::sqrt(map->camera_covariance(*pixel).trace() / 2 +
                                   options_.least_sigma_px * options_.least_sigma_px);
    if (!(sigma <= options_.largest_sigma_px)) return;
    found[i] = Sample{capture, hub, static_cast<std::uint32_t>(i), panel, {camera, *pixel, sigma}};
  });
  for (auto& sample : found)
    if (sample) samples_.push_back(*std::move(sample));
}

std::vector<Track> TrackBuilder::tracks() const {
  std::map<std::tuple<std::size_t, std::size_t, std::uint32_t>, Track> joined;
  for (const Sample& sample : samples_) {
    Track& track = joined[{sample.capture, sample.hub, sample.cell}];
    if (track.views.empty()) {
      track.capture = sample.capture;
      track.views.push_back({sample.hub, sample.hub_pixel, options_.hub_sigma_px});
    }
    track.views.push_back(sample.view);
  }
  // Evenly: per capture and hub the same share, in the order of the lattice; long tracks first.
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const Track*>> groups;
  for (const auto& [key, track] : joined)
    groups[{std::get<0>(key), std::get<1>(key)}].push_back(&track);
  const double share = std::min(
      1.0, static_cast<double>(options_.max_tracks) / std::max<double>(1, double(joined.size())));
  std::vector<Track> tracks;
  for (auto& [key, group] : groups) {
    const auto wanted =
        static_cast<std::size_t>(std::floor(share * static_cast<double>(group.size())));
    std::vector<const Track*> chosen;
    for (const bool is_long : {true, false}) {
      std::vector<const Track*> pool;
      for (const Track* track : group)
        if ((track->views.size() > 2) == is_long) pool.push_back(track);
      const std::vector<const Track*> picked = evenly_picked(pool, wanted - chosen.size());
      chosen.insert(chosen.end(), picked.begin(), picked.end());
    }
    for (const Track* track : chosen) tracks.push_back(*track);
  }
  return tracks;
}

}  // namespace pencilscan
