#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/report/palette.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// A virtual camera that looks along -`direction` (world; towards the eye) at a sphere, which it
/// sees whole. Square pixels, no distortion.
[[nodiscard]] Device make_view(const Sphere& scene, const Vec3& direction, int width, int height);

struct ShadeOptions {
  std::vector<Color> vertex_colors;  ///< empty (clay, invented parts in blue) or one per vertex
  int supersampling = 2;             ///< rays per pixel side, in [1, 4]
  const Rig* devices = nullptr;      ///< draws the frusta of its cameras and projectors
};

/// A mesh ready to be drawn many times: rays, smooth normals and ambient occlusion are kept.
class MeshPainter {
 public:
  /// `occlusion_rays`: per vertex, of ambient occlusion; 0: none.
  explicit MeshPainter(const TriangleMesh& mesh, int occlusion_rays = 24);

  /// Smoothly shaded on a light studio ground. CV_8UC3 RGB.
  [[nodiscard]] cv::Mat draw(const Device& view, const ShadeOptions& options = {}) const;
  /// Share of each pixel that the mesh covers: CV_32F in [0, 1].
  [[nodiscard]] cv::Mat coverage(const Device& view, int supersampling = 2) const;

 private:
  RayScene scene_;
  std::vector<Vec3> normals_;
  std::vector<float> openness_;  ///< per vertex: share of the hemisphere that is free
};

/// Points as small discs of `radius_mm` on a dark ground, with eye-dome lighting (Boucheny, 2009):
/// a pixel is darkened by how much nearer its neighbours are. colors: one per point. CV_8UC3 RGB.
[[nodiscard]] cv::Mat point_view(std::span<const Vec3> points, std::span<const Color> colors,
                                 const Device& view, double radius_mm);

/// Distance of every vertex to the true surface, mm.
[[nodiscard]] std::vector<double> distances_to(const RayScene& truth, const TriangleMesh& mesh);
/// Colours of distances on the sequential map, 0 to high_mm.
[[nodiscard]] std::vector<Color> distance_colors(std::span<const double> distances, double high_mm);

/// Pictures of one size in rows of `columns`, each with its label below.
[[nodiscard]] cv::Mat contact_sheet(std::span<const cv::Mat> pictures,
                                    std::span<const std::string> labels, int columns);

}  // namespace pencilscan
