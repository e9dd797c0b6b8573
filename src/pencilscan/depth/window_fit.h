#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "pencilscan/depth/depth_map.h"
#include "pencilscan/depth/family_equations.h"
#include "pencilscan/depth/pattern_view.h"
#include "pencilscan/depth/window_equations.h"
#include "pencilscan/depth/window_parts.h"
#include "pencilscan/depth/window_sums.h"

namespace pencilscan {

/// Variance of an image value: offset + slope * value.
struct NoiseModel {
  float offset = 1e-5F;
  float slope = 0;
  [[nodiscard]] float variance(float value) const { return offset + slope * std::max(0.F, value); }
};

/// What one camera sees, as the photometric fit needs it.
struct CameraLight {
  const Camera* camera = nullptr;
  std::shared_ptr<const Camera> own_camera;  ///< `camera`, where the rig has no such one
  std::vector<PatternView> patterns;         ///< of all families
  std::vector<cv::Mat> families;             ///< per family: presence channel, CV_32FC1, linear
  /// Per family: CV_8U, 0 where a mosaic has no sample of its presence; empty: all pixels have.
  std::vector<cv::Mat> sampled;
  cv::Mat valid;                  ///< CV_8U, 0 where saturated
  float spacing_px = 0;           ///< of lines, where the camera sees the volume's centre
  float line_px = 0;              ///< their width there
  bool of_mosaic = false;         ///< raw, or its colours were filled in
  bool is_measured = false;       ///< blur and noise are what enough of its windows show
  float blur_px = 0.8F;           ///< standard deviation of camera and projector blur together
  std::vector<NoiseModel> noise;  ///< per family
  float usual_residual = 0;       ///< WindowFit::relative_residual, median of the pilot windows
};

/// Inverse depth over a window: w = q . (1, x, y, x^2, x y, y^2), x = dx / half, y = dy / half, to
/// second order. Farther out it is that of the surface that has this tangent plane and rises over
/// it by this bow (WindowSurface): like a ball, it may end in an outline.
using Quadric = Eigen::Matrix<double, 6, 1>;

/// A node's quadric as it is `way` px from the node.
[[nodiscard]] Quadric quadric_at(const DepthNode& node, const Vec2& way, int half);
void set_quadric(const Quadric& q, int half, DepthNode& node);

struct WindowFit {
  Quadric q = Quadric::Zero();
  double variance = 0;          ///< of q[0], 1/mm^2, misfit included
  Mat6 information;             ///< of q: inverse covariance, misfit included
  float misfit = 0;             ///< chi^2 per degree of freedom against the noise model
  float relative_residual = 0;  ///< root mean square over the largest amplitude
  LitPatterns lit;              ///< patterns found
  bool cut = false;             ///< a side of the window does not belong to the surface
  float amplitude = 0;          ///< largest, image value
  float lines_per_w = 0;        ///< largest |dl / dw| of a lit pattern
};

/// Fits inverse depth to the image of a circular window by Gauss-Newton. The image of family f is
///   I_f = o_f + (1 + e_f . (x, y)) * sum over its lit patterns k of A_k P(l_k(dx, dy, w)),
/// P: box of the line's width blurred by a bell of standard deviation s_k (lines), to which camera
/// blur contributes blur_px * |grad l_k|. The bell is the triweight kernel (1 - u^2)^3, whose
/// integral is a polynomial. e_f takes the slope of albedo and shading. Least are the squares over
/// the noise's variance, weighted by 1 - (x^2 + y^2) / 2, with weak priors on e_f (0.3) and on the
/// quadric's bow (6 footprints). The blur follows the slope of w between steps. Steps take the
/// slopes of the quadric for those of the surface, which differ beyond the second order.
///
/// Where the surface ends within the window, pixels beyond its edge (WindowParts::edge()), and
/// those that blur mixes with the dark, are left out: to fit darkness, it would come nearer to the
/// camera.
class WindowFitter {
 public:
  /// half: radius, px, in [2, 10].
  WindowFitter(const CameraLight& light, int half);
  WindowFitter(const WindowFitter&) = delete;  // its equations point to its grid
  WindowFitter& operator=(const WindowFitter&) = delete;

  /// Nothing where the window leaves the image, is saturated or shows no line that fits. It rests
  /// as soon as the middle's depth does: slopes may be a hundredth of a line over the window off
  /// then.
  [[nodiscard]] std::optional<WindowFit> fit(const Vec2& pixel, const Quadric& start, int rounds);
  /// Mean image value and variance of the residuals of a family, of the last window that did fit.
  [[nodiscard]] float family_mean(std::size_t family) const { return seen_[family].mean; }
  [[nodiscard]] float family_variance(std::size_t family) const { return seen_[family].variance; }
  [[nodiscard]] int half() const { return grid_.half; }

 private:
  struct Lit {
    int pattern = 0;
    int family = 0;
    WindowLines lines;
    float inverse_reach = 0;  ///< 1 / reach of the bell, 1/lines
    float amplitude = 0;
    int unknown = 0;  ///< of its family, in the last equations
    bool on = true;
  };
  /// What the window shows of a family; arrays of the grid's pixels.
  struct Seen {
    std::vector<float> image, weight, root;  ///< root: of the weight
    float weight_sum = 0;
    float sampled_share = 1;  ///< of the pixels, a mosaic's samples
    float inverse_variance = 0;
    float mean = 0;      ///< of the image
    float variance = 0;  ///< of the residuals
    FamilyLight light;
  };

  [[nodiscard]] bool gather(int u, int v);
  void set_weight(Seen& seen);
  void choose_patterns(const Quadric& q);
  [[nodiscard]] WindowSurface surface_of(const Quadric& q) const;
  void render(const Quadric& q);
  /// Lists the patterns of a family that are on.
  void collect(std::size_t family);
  void solve_amplitudes();
  void solve_amplitudes(std::size_t family);
  /// The equations of the next step, eliminated; false where they have no solution.
  [[nodiscard]] bool evaluate(const Quadric& q);
  void add_family(std::size_t family, float unit);
  /// Goes where the equations lead; returns how far the lines move at most.
  [[nodiscard]] double step(Quadric& q);
  [[nodiscard]] bool iterate(Quadric& q, int rounds);
  /// Leaves out what lies beyond an edge, and its blur; false where there is none.
  [[nodiscard]] bool cut_at_edge();
  /// Light that the fit predicts at each pixel, and what is seen of it, over the parts.
  void compare_light();
  [[nodiscard]] std::optional<WindowFit> finish(const Quadric& q, bool cut);

  const CameraLight* light_;
  WindowGrid grid_;
  WindowParts parts_;
  Vec2 m_ = Vec2::Zero();                                   ///< the middle, normalised
  Eigen::Matrix2d jacobian_ = Eigen::Matrix2d::Identity();  ///< of it, per px
  std::vector<float> valid_, w_;
  std::vector<Seen> seen_;  ///< per family
  std::vector<Lit> lit_;
  std::vector<std::vector<float>> profile_, slope_;  ///< per lit: P, dP/dw
  FamilyEquations of_family_;
  WindowEquations equations_;
  double chi2_ = 0, degrees_ = 0;  ///< of the last equations
};

}  // namespace pencilscan
