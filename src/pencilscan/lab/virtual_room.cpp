#include "pencilscan/lab/virtual_room.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pencilscan/core/host_clock.h"

namespace pencilscan {
namespace {

/// What black of a projector is of its white: as in simulated captures.
constexpr double kRoomBlackLevel = 0.004;

/// What a panel shows of a picture of any size.
cv::Mat on_panel(const cv::Mat& picture, const Projector& projector, double zoom) {
  const cv::Size panel(projector.width, projector.height);
  if (picture.empty()) return {};
  if (picture.size() == panel && zoom == 1) return picture;
  cv::Mat result;
  const double across = zoom * panel.width / picture.cols;
  const double down = zoom * panel.height / picture.rows;
  // Middle on middle; pixel centres at whole numbers.
  const cv::Matx23d place(across, 0, 0.5 * (panel.width - 1) - across * 0.5 * (picture.cols - 1), 0,
                          down, 0.5 * (panel.height - 1) - down * 0.5 * (picture.rows - 1));
  cv::warpAffine(picture, result, place, panel, cv::INTER_LINEAR);
  return result;
}

}  // namespace

VirtualRoom::VirtualRoom(Rig rig, const PhotographyOptions& photo)
    : rig_(std::move(rig)),
      photo_(photo),
      black_level_(photo.black_level.value_or(kRoomBlackLevel)),
      lamps_(rig_.projectors.size()),
      shown_(rig_.projectors.size()) {
  for (std::size_t p = 0; p < lamps_.size(); ++p) lamps_[p].output = p;
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    eyes_.push_back(std::make_unique<Eye>());
    eyes_.back()->by_projector.resize(lamps_.size());
  }
}

void VirtualRoom::place(const SimulatedObject& object) {
  auto scene = std::make_shared<Scene>();
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c)
    scene->views.emplace_back(rig_, c, object, scene_light(photo_));
  const std::lock_guard lock(mutex_);
  scene_ = std::move(scene);
}

void VirtualRoom::show(std::size_t output, std::int64_t time_ns, const cv::Mat& picture) {
  const std::lock_guard lock(mutex_);
  shown_[output] = picture.clone();
  for (std::size_t p = 0; p < lamps_.size(); ++p)
    if (lamps_[p].output == output)
      lamps_[p].history.add(time_ns, on_panel(picture, rig_.projectors[p], lamps_[p].zoom));
}

const cv::Mat& VirtualRoom::addition(Eye& eye, std::size_t camera, std::size_t projector,
                                     const LightHistory::Picture& picture) const {
  auto& kept = eye.by_projector[projector];
  if (kept[1].picture == picture) std::swap(kept[0], kept[1]);
  if (kept[0].picture == picture) return kept[0].light;
  std::swap(kept[0], kept[1]);
  const Camera& device = rig_.cameras[camera];
  kept[0].light = cv::Mat(device.height, device.width, CV_32FC3, cv::Scalar::all(0));
  kept[0].picture = picture;
  eye.scene->views[camera].add(projector, {*picture, Vec3::Ones(), black_level_}, kept[0].light);
  return kept[0].light;
}

cv::Mat VirtualRoom::expose(std::size_t camera, std::int64_t begin_ns, double exposure_us,
                            double gain, const std::optional<Mosaic>& mosaic) {
  Eye& eye = *eyes_[camera];
  const std::lock_guard eye_lock(eye.mutex);
  const auto exposure_ns = std::max<std::int64_t>(1, std::llround(1e3 * exposure_us));
  std::vector<std::vector<LightHistory::Part>> parts;
  {
    const std::lock_guard lock(mutex_);
    if (eye.scene != scene_) {
      eye.scene = scene_;
      for (auto& kept : eye.by_projector) kept = {};
    }
    for (const Lamp& lamp : lamps_)
      parts.push_back(
          lamp.history.during(begin_ns - lamp.delay_ns, begin_ns + exposure_ns - lamp.delay_ns));
  }
  const Camera& device = rig_.cameras[camera];
  cv::Mat light(device.height, device.width, CV_32FC3, cv::Scalar::all(0));
  if (eye.scene) {
    light = eye.scene->views[camera].ambient();
    for (std::size_t p = 0; p < parts.size(); ++p)
      for (const LightHistory::Part& part : parts[p])
        if (!part.picture->empty())
          cv::scaleAdd(addition(eye, camera, p, part.picture), part.share, light, light);
  }
  light *= gain * exposure_us / (1000 * kRoomExposureMs);
  SensorOptions sensor = camera_sensor(photo_, device);
  sensor.mosaic = mosaic;
  sensor.interpolated = false;
  sensor.bit_depth = 8;
  const auto number = static_cast<std::uint32_t>(camera + rig_.cameras.size() * eye.pictures++);
  return apply_sensor(light, sensor, photo_.seed, number);
}

void VirtualRoom::set_delay(std::size_t projector, double ms) {
  const std::lock_guard lock(mutex_);
  lamps_[projector].delay_ns = std::llround(1e6 * ms);
}

void VirtualRoom::swap_cables(std::size_t a, std::size_t b) {
  const std::lock_guard lock(mutex_);
  std::swap(lamps_[a].output, lamps_[b].output);
  for (const std::size_t p : {a, b})
    lamps_[p].history.add(host_now_ns(),
                          on_panel(shown_[lamps_[p].output], rig_.projectors[p], lamps_[p].zoom));
}

void VirtualRoom::set_zoom(std::size_t projector, double factor) {
  const std::lock_guard lock(mutex_);
  Lamp& lamp = lamps_[projector];
  lamp.zoom = factor;
  lamp.history.add(host_now_ns(),
                   on_panel(shown_[lamp.output], rig_.projectors[projector], factor));
}

}  // namespace pencilscan
