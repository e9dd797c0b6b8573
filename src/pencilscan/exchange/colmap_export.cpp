#include <iomanip>
#include <limits>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/exchange/colmap_model.h"
#include "pencilscan/exchange/unheld.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

std::ostringstream exact_text(const char* comment) {
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "# " << comment << "\n";
  return text;
}

/// MODEL WIDTH HEIGHT PARAMS[].
void write_camera(const Device& device, std::ostream& text) {
  if (device.K(0, 1) != 0)
    throw InputError("rig", "K of " + device.name, std::to_string(device.K(0, 1)),
                     "COLMAP knows no skew: K[0][1] must be 0");
  const Distortion& k = device.distortion;
  const bool is_full = k[Distortion::kK3] != 0 || k.is_rational();
  const char* model = is_full ? "FULL_OPENCV" : device.has_distortion() ? "OPENCV" : "PINHOLE";
  text << model << " " << device.width << " " << device.height << " " << device.K(0, 0) << " "
       << device.K(1, 1) << " " << device.K(0, 2) + kColmapHalfPixel << " "
       << device.K(1, 2) + kColmapHalfPixel;
  constexpr std::size_t kOfOpencvModel = 4;
  const std::size_t count = is_full ? k.k.size() : device.has_distortion() ? kOfOpencvModel : 0;
  for (std::size_t i = 0; i < count; ++i) text << " " << k[i];
  text << "\n";
}

/// QW QX QY QZ TX TY TZ.
void write_colmap_pose(const RigidTransform& pose, std::ostream& text) {
  const Eigen::Quaterniond q(pose.rotation);
  text << q.w() << " " << q.x() << " " << q.y() << " " << q.z();
  for (const double t : pose.translation) text << " " << t;
}

void check_name(const std::string& name) {
  if (name.find_first_of(" \t#") != std::string::npos || name.empty())
    throw InputError("rig", "name", name, "COLMAP knows no names with blanks or #");
}

}  // namespace

void write_colmap(const Rig& rig, std::span<const MeasuredPoint> points,
                  const std::filesystem::path& folder, std::size_t most_points) {
  require_distinct_names(rig);
  std::vector<const Device*> devices;
  for (const Camera& camera : rig.cameras) devices.push_back(&camera);
  for (const Projector& projector : rig.projectors) devices.push_back(&projector);
  const std::vector<MeasuredPoint> picked = evenly_picked(points, most_points);
  std::vector<std::vector<std::size_t>> seen(devices.size());  // points of each image
  std::vector<std::size_t> place(picked.size());               // of a point in its image
  for (std::size_t i = 0; i < picked.size(); ++i) {
    if (picked[i].camera >= rig.cameras.size())
      throw InputError("points", "camera", std::to_string(picked[i].camera),
                       "must be a camera of the rig");
    place[i] = seen[picked[i].camera].size();
    seen[picked[i].camera].push_back(i);
  }
  std::ostringstream cameras = exact_text("CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]");
  std::ostringstream images = exact_text(
      "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of X Y POINT3D_ID of its points");
  std::ostringstream surface = exact_text("POINT3D_ID X Y Z R G B ERROR TRACK[] (IMAGE_ID PLACE)");
  for (std::size_t d = 0; d < devices.size(); ++d) {
    check_name(devices[d]->name);
    cameras << d + 1 << " ";
    write_camera(*devices[d], cameras);
    images << d + 1 << " ";
    write_colmap_pose(devices[d]->device_from_world, images);
    images << " " << d + 1 << " " << devices[d]->name << ".png\n";
    for (const std::size_t i : seen[d])
      images << picked[i].u + kColmapHalfPixel << " " << picked[i].v + kColmapHalfPixel << " "
             << i + 1 << " ";
    images << "\n";
  }
  constexpr const char* kGreyWithoutError = " 160 160 160 0 ";
  for (std::size_t i = 0; i < picked.size(); ++i)
    surface << i + 1 << " " << picked[i].x << " " << picked[i].y << " " << picked[i].z
            << kGreyWithoutError << picked[i].camera + 1 << " " << place[i] << "\n";
  write_text(folder / "cameras.txt", cameras.str());
  write_text(folder / "images.txt", images.str());
  write_text(folder / "points3D.txt", surface.str());
}

}  // namespace pencilscan
