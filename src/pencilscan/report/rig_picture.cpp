#include "pencilscan/report/rig_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/report/device_drawing.h"
#include "pencilscan/report/palette.h"

namespace pencilscan {
namespace {

constexpr double kFixed = 1 << kSubpixelBits;
constexpr double kNameSize = 0.5;
const Color kInk{40, 44, 52};
const Color kFaint{150, 156, 166};
const Color kVolumeColor{16, 128, 96};

/// The rig's devices with the colours they are drawn in.
struct DrawnDevice {
  const Device* device;
  Color color;
};

/// A parallel projection of the world along one axis.
class RigView {
 public:
  RigView(const char* title, Eigen::Index up_axis, const char* up_name, cv::Mat canvas)
      : title_(title), up_axis_(up_axis), up_name_(up_name), canvas_(std::move(canvas)) {}

  /// Scale and shift so that everything lies within the margins.
  void fit(const std::vector<Vec3>& points, double px_per_mm) {
    px_per_mm_ = px_per_mm;
    Vec2 low = flat(points.front());
    Vec2 high = low;
    for (const Vec3& x : points) {
      low = low.cwiseMin(flat(x));
      high = high.cwiseMax(flat(x));
    }
    middle_ = (low + high) / 2;
  }

  [[nodiscard]] Vec2 flat(const Vec3& x) const { return {x.x(), x[up_axis_]}; }
  [[nodiscard]] Vec2 at(const Vec3& x) const {
    const Vec2 offset = px_per_mm_ * (flat(x) - middle_);
    return Vec2(canvas_.cols / 2.0, canvas_.rows / 2.0) + Vec2(offset.x(), -offset.y());
  }

  void draw_volume(const Sphere& volume) {
    const cv::Point middle = fixed(at(volume.center));
    const int radius = static_cast<int>(std::lround(kFixed * px_per_mm_ * volume.radius));
    cv::Mat layer = canvas_.clone();
    cv::circle(layer, middle, radius, {214, 224, 234}, cv::FILLED, cv::LINE_AA, kSubpixelBits);
    cv::addWeighted(layer, 0.7, canvas_, 0.3, 0, canvas_);
    outline_volume(volume);
  }
  /// Once more above the cones.
  void outline_volume(const Sphere& volume) {
    const int radius = static_cast<int>(std::lround(kFixed * px_per_mm_ * volume.radius));
    cv::circle(canvas_, fixed(at(volume.center)), radius, scalar(kVolumeColor), 2, cv::LINE_AA,
               kSubpixelBits);
  }

  /// The pyramid that a device sees down to `depth`, as its outline.
  void draw_cone(const DrawnDevice& d, double depth) {
    std::vector<cv::Point> points{fixed(at(d.device->center()))};
    for (const double u : {-0.5, d.device->width - 0.5})
      for (const double v : {-0.5, d.device->height - 0.5})
        points.push_back(fixed(at(d.device->point_at_depth({u, v}, depth))));
    std::vector<cv::Point> hull;
    cv::convexHull(points, hull);
    cv::Mat layer = canvas_.clone();
    cv::fillConvexPoly(layer, hull, scalar(d.color), cv::LINE_AA, kSubpixelBits);
    cv::addWeighted(layer, 0.06, canvas_, 0.94, 0, canvas_);
    cv::polylines(canvas_, hull, true, 0.45 * scalar(d.color) + 0.55 * cv::Scalar::all(255), 1,
                  cv::LINE_AA, kSubpixelBits);
  }

  /// A dot and a short arrow along the optical axis.
  void draw_body(const DrawnDevice& d, double length_mm) {
    const Vec3 eye = d.device->center();
    cv::line(canvas_, fixed(at(eye)), fixed(at(eye + length_mm * d.device->forward())),
             scalar(d.color), 2, cv::LINE_AA, kSubpixelBits);
    cv::circle(canvas_, fixed(at(eye)), static_cast<int>(6 * kFixed), scalar(d.color), cv::FILLED,
               cv::LINE_AA, kSubpixelBits);
    taken_.emplace_back(static_cast<int>(at(eye).x()) - 7, static_cast<int>(at(eye).y()) - 7, 14,
                        14);
  }

  /// The name beside the dot where it covers nothing, outwards if possible.
  void draw_name(const DrawnDevice& d) {
    constexpr int kDirections = 16;
    constexpr double kGap = 11;
    int baseline = 0;
    const cv::Size size =
        cv::getTextSize(d.device->name, cv::FONT_HERSHEY_SIMPLEX, kNameSize, 1, &baseline);
    const Vec2 dot = at(d.device->center());
    const Vec2 outwards = dot - Vec2(canvas_.cols / 2.0, canvas_.rows / 2.0);
    const double first = std::atan2(outwards.y(), outwards.x());
    cv::Rect box;
    bool is_free = false;
    for (int ring = 0; ring < 4 && !is_free; ++ring) {
      for (int i = 0; i < kDirections && !is_free; ++i) {
        const double turn = (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2) * 2 * M_PI / kDirections;
        const Vec2 away(std::cos(first + turn), std::sin(first + turn));
        const Vec2 middle = dot + (kGap + 16 * ring) * away +
                            Vec2(0.5 * size.width * away.x(), 0.5 * size.height * away.y());
        box = cv::Rect(static_cast<int>(middle.x()) - size.width / 2 - 2,
                       static_cast<int>(middle.y()) - size.height / 2 - 3, size.width + 4,
                       size.height + 6);
        is_free = (box & cv::Rect(0, 0, canvas_.cols, canvas_.rows)) == box &&
                  std::none_of(taken_.begin(), taken_.end(),
                               [&](const cv::Rect& other) { return (box & other).area() > 0; });
      }
    }
    taken_.push_back(box);
    const cv::Point left(box.x + 2, box.y + size.height + 2);
    cv::putText(canvas_, d.device->name, left, cv::FONT_HERSHEY_SIMPLEX, kNameSize,
                cv::Scalar(250, 250, 251), 4, cv::LINE_AA);
    draw_text(canvas_, d.device->name, left, d.color, kNameSize);
  }

  void draw_frame(double volume_radius, const std::string& unit) {
    draw_text(canvas_, title_, {16, 28}, kInk, 0.6);
    const cv::Point corner(24, canvas_.rows - 60);
    for (const cv::Point& tip : {corner + cv::Point(34, 0), corner - cv::Point(0, 34)})
      cv::arrowedLine(canvas_, corner, tip, scalar(kInk), 1, cv::LINE_AA, 0, 0.2);
    draw_text(canvas_, "x", corner + cv::Point(38, 4), kInk, kNameSize);
    draw_text(canvas_, up_name_, corner + cv::Point(-4, -38), kInk, kNameSize);
    // A round length that fills about a fifth of the view.
    const double wanted = canvas_.cols / 5.0 / px_per_mm_;
    const double power = std::pow(10, std::floor(std::log10(wanted)));
    const double length = power * (wanted >= 5 * power ? 5 : wanted >= 2 * power ? 2 : 1);
    const int bar = static_cast<int>(std::lround(length * px_per_mm_));
    const cv::Point left(24, canvas_.rows - 26);
    cv::line(canvas_, left, left + cv::Point(bar, 0), scalar(kInk), 2);
    for (const int x : {0, bar})
      cv::line(canvas_, left + cv::Point(x, -5), left + cv::Point(x, 5), scalar(kInk), 2);
    std::array<char, 60> text{};
    std::snprintf(text.data(), text.size(), "%g%s", length, unit.c_str());
    draw_text(canvas_, text.data(), left + cv::Point(bar + 10, 5), kInk, kNameSize);
    std::snprintf(text.data(), text.size(), "volume, radius %.4g%s", volume_radius, unit.c_str());
    draw_text(canvas_, text.data(), {16, 52}, kVolumeColor, kNameSize);
  }

 private:
  [[nodiscard]] static cv::Point fixed(const Vec2& px) {
    return {static_cast<int>(std::lround(kFixed * px.x())),
            static_cast<int>(std::lround(kFixed * px.y()))};
  }

  const char* title_;
  Eigen::Index up_axis_;
  const char* up_name_;
  cv::Mat canvas_;
  double px_per_mm_ = 1;
  Vec2 middle_ = Vec2::Zero();
  std::vector<cv::Rect> taken_;
};

}  // namespace

cv::Mat draw_rig(const Rig& rig, int side_px) {
  constexpr double kShareOfView = 0.8;  // the rest is for names
  std::vector<DrawnDevice> devices;
  for (const Projector& projector : rig.projectors)
    devices.push_back({&projector, light_color(projector)});
  for (const Camera& camera : rig.cameras) devices.push_back({&camera, kInk});
  const Sphere volume = working_volume(rig);
  std::vector<Vec3> points;
  for (const DrawnDevice& d : devices) points.push_back(d.device->center());
  for (Eigen::Index k = 0; k < 3; ++k)
    for (const double side : {-1, 1})
      points.push_back(volume.center + side * volume.radius * Vec3::Unit(k));
  Vec3 low = points.front();
  Vec3 high = low;
  for (const Vec3& x : points) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  const double extent = (high - low).maxCoeff();
  const double px_per_mm = kShareOfView * side_px / std::max(extent, 1e-9);
  cv::Mat picture(side_px, 2 * side_px, CV_8UC3, cv::Scalar(250, 250, 251));
  constexpr Eigen::Index kY = 1;
  constexpr Eigen::Index kZ = 2;
  RigView above("from above", kY, "y", picture(cv::Rect(0, 0, side_px, side_px)));
  RigView beside("from the side", kZ, "z", picture(cv::Rect(side_px, 0, side_px, side_px)));
  for (RigView* view : {&above, &beside}) {
    view->fit(points, px_per_mm);
    view->draw_volume(volume);
    for (const DrawnDevice& d : devices)
      view->draw_cone(d,
                      std::max((d.device->device_from_world * volume.center).z(), 0.05 * extent));
    view->outline_volume(volume);
    for (const DrawnDevice& d : devices) view->draw_body(d, 0.05 * extent);
    for (const DrawnDevice& d : devices) view->draw_name(d);
    view->draw_frame(volume.radius, " " + unit_name(rig));
  }
  cv::line(picture, {side_px, 0}, {side_px, side_px}, scalar(kFaint), 1);
  return picture;
}

}  // namespace pencilscan
