#include "pencilscan/simulation/light_transport.h"

#include <algorithm>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/simulation/shading.h"

namespace pencilscan {
namespace {

struct Entry {
  std::uint32_t pixel = 0;
  float weight = 0;
};

/// What each row of a camera's pixels sees of one projector.
struct Row {
  std::vector<std::uint32_t> count;  ///< entries per pixel
  std::vector<Entry> entries;
};

/// The panel pixels under a box, with their shares of it; what lies beyond the panel is dark.
void add_box(const Vec2& center, const Vec2& box, const cv::Size& panel, double weight,
             std::vector<Entry>& entries) {
  // As PanelProfile: narrower boxes see one place.
  const double width = std::max(box.x(), 1e-6);
  const double height = std::max(box.y(), 1e-6);
  const double left = center.x() + 0.5 - 0.5 * width;  // panel pixel i covers [i, i + 1]
  const double top = center.y() + 0.5 - 0.5 * height;
  const int first_x = std::max(0, static_cast<int>(std::floor(left)));
  const int first_y = std::max(0, static_cast<int>(std::floor(top)));
  const int last_x = std::min(panel.width - 1, static_cast<int>(std::floor(left + width)));
  const int last_y = std::min(panel.height - 1, static_cast<int>(std::floor(top + height)));
  for (int y = first_y; y <= last_y; ++y) {
    const double down = std::min(y + 1.0, top + height) - std::max<double>(y, top);
    for (int x = first_x; x <= last_x; ++x) {
      const double across = std::min(x + 1.0, left + width) - std::max<double>(x, left);
      const double share = down * across / (width * height);
      if (share <= 0) continue;
      entries.push_back(
          {static_cast<std::uint32_t>(y * panel.width + x), static_cast<float>(weight * share)});
    }
  }
}

/// Entries of the same panel pixel become one, from `first` on.
void merge(std::vector<Entry>& entries, std::size_t first) {
  const auto begin = entries.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, entries.end(), [](const Entry& a, const Entry& b) { return a.pixel < b.pixel; });
  auto last = begin;
  for (auto it = begin; it != entries.end(); ++it) {
    if (it != begin && it->pixel == last->pixel)
      last->weight += it->weight;
    else if (it != begin)
      *++last = *it;
  }
  if (begin != entries.end()) entries.erase(last + 1, entries.end());
}

}  // namespace

LightTransport::LightTransport(const Rig& rig, std::size_t camera_index,
                               const SimulatedObject& object, const RenderOptions& options) {
  const Camera& camera = rig.cameras[camera_index];
  bool registered = !camera.color_registration.none();
  for (const Projector& projector : rig.projectors)
    registered = registered || !projector.color_registration.none();
  if (registered)
    throw InputError("rig", "color_registration", "",
                     "must be absent: live pictures are rendered without it");
  const PixelRays rays(camera, object, options.samples);
  const double per_ray = 1.0 / (options.samples * options.samples);
  ambient_ = cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar::all(0));
  const auto rows = static_cast<std::size_t>(camera.height);
  const std::size_t projectors = rig.projectors.size();
  std::vector<Lamp> lamps;
  for (std::size_t p = 0; p < projectors; ++p) lamps.push_back(make_lamp(rig, p));
  std::vector<std::vector<Row>> found(projectors, std::vector<Row>(rows));
  parallel_for(rows, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (std::size_t p = 0; p < projectors; ++p)
      found[p][row].count.assign(static_cast<std::size_t>(camera.width), 0);
    std::vector<std::size_t> before(projectors);
    for (int x = 0; x < camera.width; ++x) {
      for (std::size_t p = 0; p < projectors; ++p) before[p] = found[p][row].entries.size();
      rays.for_each_hit(x, y, [&](const SightedPoint& sample, const Vec3&) {
        const double albedo = object.albedo_at(sample.point);
        ambient_.at<float>(y, x) += static_cast<float>(per_ray * options.ambient * albedo);
        for (std::size_t p = 0; p < projectors; ++p) {
          const Projector& projector = rig.projectors[p];
          const auto light = incidence(projector, lamps[p].center, sample);
          if (!light || !object.lit(sample.point, sample.face_normal, lamps[p].center)) continue;
          add_box(light->pixel, light->footprint_px / options.samples,
                  {projector.width, projector.height},
                  per_ray * reflected(object, sample, albedo, lamps[p], *light, options),
                  found[p][row].entries);
        }
      });
      for (std::size_t p = 0; p < projectors; ++p) {
        merge(found[p][row].entries, before[p]);
        found[p][row].count[static_cast<std::size_t>(x)] =
            static_cast<std::uint32_t>(found[p][row].entries.size() - before[p]);
      }
    }
  });
  for (std::size_t p = 0; p < projectors; ++p) {
    Table table;
    const Projector& projector = rig.projectors[p];
    table.panel = {projector.width, projector.height};
    table.color = camera.color_matrix_for(projector.name).cast<float>();
    table.begin.reserve(rows * static_cast<std::size_t>(camera.width) + 1);
    std::size_t total = 0;
    for (const Row& row : found[p]) total += row.entries.size();
    table.pixel.reserve(total);
    table.weight.reserve(total);
    std::uint32_t end = 0;
    table.begin.push_back(0);
    for (Row& row : found[p]) {
      for (const std::uint32_t count : row.count) table.begin.push_back(end += count);
      for (const Entry& entry : row.entries) {
        table.pixel.push_back(entry.pixel);
        table.weight.push_back(entry.weight);
      }
      row = {};
    }
    tables_.push_back(std::move(table));
  }
}

cv::Mat LightTransport::ambient() const {
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>(3, ambient_), image);
  return image;
}

void LightTransport::add(std::size_t projector, const PanelPicture& panel, cv::Mat& image) const {
  if (panel.light.empty()) return;
  const Table& table = tables_[projector];
  PENCILSCAN_CHECK(panel.light.type() == CV_8UC3 && panel.light.isContinuous() &&
                   panel.light.size() == table.panel && image.type() == CV_32FC3 &&
                   image.size() == ambient_.size());
  // What a panel value becomes in the camera, colours mixed and scaled.
  const Eigen::Matrix3f mix = table.color * panel.gain.cast<float>().asDiagonal() / 255.F;
  const auto black = static_cast<float>(panel.black_level);
  const std::uint8_t* pixels = panel.light.data;
  const auto width = static_cast<std::size_t>(image.cols);
  parallel_for(static_cast<std::size_t>(image.rows), [&](std::size_t row) {
    auto* out = image.ptr<float>(static_cast<int>(row));
    const std::uint32_t* begin = table.begin.data() + row * width;
    for (std::size_t x = 0; x < width; ++x) {
      if (begin[x] == begin[x + 1]) continue;
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      float all = 0;
      for (std::uint32_t i = begin[x]; i < begin[x + 1]; ++i) {
        const std::uint8_t* value = pixels + 3 * static_cast<std::size_t>(table.pixel[i]);
        sum += table.weight[i] * Eigen::Vector3f(value[0], value[1], value[2]);
        all += table.weight[i];
      }
      const Eigen::Vector3f seen =
          mix * ((1 - black) * sum + Eigen::Vector3f::Constant(255 * black * all));
      for (std::size_t k = 0; k < 3; ++k) out[3 * x + k] += seen[static_cast<Eigen::Index>(k)];
    }
  });
}

cv::Mat LightTransport::render(std::span<const PanelPicture> panels) const {
  PENCILSCAN_CHECK(panels.size() == tables_.size());
  cv::Mat image = ambient();
  for (std::size_t p = 0; p < panels.size(); ++p) add(p, panels[p], image);
  return image;
}

std::size_t LightTransport::bytes() const {
  std::size_t sum = ambient_.total() * ambient_.elemSize();
  for (const Table& table : tables_)
    sum += 4 * (table.begin.size() + table.pixel.size() + table.weight.size());
  return sum;
}

}  // namespace pencilscan
