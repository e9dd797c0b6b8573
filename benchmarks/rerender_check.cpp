// Renders a scene again that another renderer made, and measures how far our lines lie from theirs.
//
//   rerender_check <scene folder> [difference.png] [--flat]
//
// The folder holds rig.json, truth/mesh.ply and frames/000000/<camera>.png (ideal sensor). In
// blocks of 16 x 16 pixels and per projector p, the given image G is explained by our own image R_p
// of that projector and its derivative D_p when the pattern moves on the panel:
//
//   G = sum_p (a_p R_p + b_p D_p),    displacement of p's lines = b_p / a_p  [panel px]
//
// by linear least squares over all pixels and channels of the block; a block's value counts when
// its formal standard deviation (from the residual) is below kUsableSigma. The amplitude a_p takes
// up whatever exposure the other renderer chose.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pencilscan/core/stopwatch.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/mesh_file.h"
#include "pencilscan/simulation/render.h"

namespace {

using namespace pencilscan;

constexpr int kBlock = 16;             // px
constexpr double kUsableSigma = 0.02;  // panel px
constexpr double kShift = 0.1;         // panel px, for the derivative
constexpr double kAmplitudeSpread = 0.15;
constexpr float kBright = 6.0F / 255;  // surely light ...
constexpr float kDark = 1.5F / 255;    // ... and surely none

struct Parts {
  std::vector<cv::Mat> image;       // per projector
  std::vector<cv::Mat> derivative;  // per projector, per panel px
  cv::Mat sum;
};

Rig shifted(Rig rig, double px) {
  for (Projector& projector : rig.projectors) {
    for (LinePattern& pattern : projector.patterns) pattern.offset_px += px;
  }
  return rig;
}

Parts render_parts(const Rig& rig, std::size_t camera, const SimulatedObject& object) {
  Parts parts;
  const auto lights = line_lights(rig);
  const auto ahead = line_lights(shifted(rig, kShift));
  const auto behind = line_lights(shifted(rig, -kShift));
  const auto alone = [&](const std::vector<PanelLight>& all, std::size_t p) {
    std::vector<PanelLight> one(all.size());
    one[p] = all[p];
    return render_camera(rig, camera, object, one);
  };
  for (std::size_t p = 0; p < lights.size(); ++p) {
    parts.image.push_back(alone(lights, p));
    parts.derivative.push_back((alone(ahead, p) - alone(behind, p)) * (0.5 / kShift));
    parts.sum = p == 0 ? parts.image[0].clone() : parts.sum + parts.image[p];
  }
  return parts;
}

struct Sample {
  std::size_t projector;
  double displacement;
  double amplitude;
};

// One block's least squares; saturated pixels are left out.
void fit_block(const cv::Mat& given, const Parts& parts, const cv::Rect& block,
               std::vector<Sample>& samples) {
  const cv::Rect frame(0, 0, given.cols, given.rows);
  const cv::Rect inside = block & frame;
  std::vector<std::size_t> active;
  for (std::size_t p = 0; p < parts.image.size(); ++p) {
    if (cv::norm(parts.derivative[p](inside), cv::NORM_INF) > 0.02) active.push_back(p);
  }
  if (active.empty()) return;
  const auto n = static_cast<Eigen::Index>(2 * active.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  double energy = 0;
  int count = 0;
  Eigen::VectorXd row(n);
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    for (int x = inside.x; x < inside.x + inside.width; ++x) {
      for (int k = 0; k < 3; ++k) {
        const double g = given.at<cv::Vec3f>(y, x)[k];
        if (g > 0.98) continue;
        for (std::size_t i = 0; i < active.size(); ++i) {
          row[static_cast<Eigen::Index>(2 * i)] = parts.image[active[i]].at<cv::Vec3f>(y, x)[k];
          row[static_cast<Eigen::Index>(2 * i + 1)] =
              parts.derivative[active[i]].at<cv::Vec3f>(y, x)[k];
        }
        normal += row * row.transpose();
        right += g * row;
        energy += g * g;
        ++count;
      }
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal + 1e-9 * Eigen::MatrixXd::Identity(n, n));
  const Eigen::VectorXd x = solver.solve(right);
  const double variance = std::max(0.0, energy - 2 * x.dot(right) + x.dot(normal * x)) /
                          std::max(1, count - static_cast<int>(n));
  const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(n, n));
  for (std::size_t i = 0; i < active.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(2 * i);
    const double sigma =
        std::sqrt(variance * std::max(0.0, inverse(at + 1, at + 1))) / std::abs(x[at]);
    if (!(sigma < kUsableSigma)) continue;
    samples.push_back({active[i], x[at + 1] / x[at], x[at]});
  }
}

cv::Mat brightest(const cv::Mat& image) {
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  return cv::max(cv::max(channels[0], channels[1]), channels[2]);
}

// Bright pixels of `a` with no light of `b` within one pixel.
int stray(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat wide;
  cv::dilate(brightest(b), wide, cv::Mat::ones(3, 3, CV_8U));
  const cv::Mat bright = brightest(a) > kBright;
  const cv::Mat dark = wide < kDark;
  const cv::Mat alone = bright & dark;
  return cv::countNonZero(alone);
}

// Leaves out samples whose amplitude is far from their projector's median.
std::vector<Sample> usable(const std::vector<Sample>& samples, std::size_t projectors) {
  std::vector<Sample> kept;
  for (std::size_t p = 0; p < projectors; ++p) {
    std::vector<double> amplitudes;
    for (const Sample& s : samples) {
      if (s.projector == p) amplitudes.push_back(s.amplitude);
    }
    if (amplitudes.empty()) continue;
    std::nth_element(amplitudes.begin(),
                     amplitudes.begin() + static_cast<std::ptrdiff_t>(amplitudes.size() / 2),
                     amplitudes.end());
    const double median = amplitudes[amplitudes.size() / 2];
    for (const Sample& s : samples) {
      if (s.projector == p && std::abs(s.amplitude / median - 1) < kAmplitudeSpread)
        kept.push_back(s);
    }
  }
  return kept;
}

double rms(const std::vector<Sample>& samples) {
  double sum = 0;
  for (const Sample& s : samples) sum += s.displacement * s.displacement;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, samples.size())));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: rerender_check <scene folder> [difference.png] [--flat]\n");
    return 2;
  }
  const std::filesystem::path scene(argv[1]);
  Reflectance surface;
  std::string difference_path;
  for (int i = 2; i < argc; ++i) {
    if (std::strcmp(argv[i], "--flat") == 0) {
      surface.smooth = false;
    } else {
      difference_path = argv[i];
    }
  }
  const Rig rig = read_rig(scene / "rig.json");
  const SimulatedObject object(read_mesh(scene / "truth" / "mesh.ply"), surface);
  std::vector<Sample> all;
  std::size_t found = 0;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::string& name = rig.cameras[c].name;
    const cv::Mat given = read_image(scene / "frames" / "000000" / (name + ".png"));
    const Parts parts = render_parts(rig, c, object);
    std::vector<Sample> samples;
    for (int y = 0; y < given.rows; y += kBlock) {
      for (int x = 0; x < given.cols; x += kBlock) {
        fit_block(given, parts, {x, y, kBlock, kBlock}, samples);
      }
    }
    found += samples.size();
    samples = usable(samples, rig.projectors.size());
    std::vector<double> amplitude(rig.projectors.size(), 0);
    std::vector<int> count(rig.projectors.size(), 0);
    double mean = 0;
    for (const Sample& s : samples) {
      amplitude[s.projector] += s.amplitude;
      ++count[s.projector];
      mean += s.displacement / static_cast<double>(samples.size());
    }
    std::printf(
        "%s: lines displaced by %.4f px RMS (mean %+.4f, %zu blocks); silhouette: %d + %d "
        "stray px; amplitudes",
        name.c_str(), rms(samples), mean, samples.size(), stray(parts.sum, given),
        stray(given, parts.sum));
    cv::Mat scaled = cv::Mat::zeros(given.size(), given.type());
    for (std::size_t p = 0; p < amplitude.size(); ++p) {
      const double a = count[p] > 0 ? amplitude[p] / count[p] : 1;
      std::printf(" %.4f", a);
      scaled += parts.image[p] * a;
    }
    std::printf("\n");
    if (!difference_path.empty() && c == 0) {
      cv::Mat difference = (given - cv::min(scaled, 1.0)) * 4 + cv::Scalar::all(0.5);
      write_image(difference_path, difference);
    }
    all.insert(all.end(), samples.begin(), samples.end());
  }
  std::vector<double> sizes;
  for (const Sample& s : all) sizes.push_back(std::abs(s.displacement));
  std::sort(sizes.begin(), sizes.end());
  if (sizes.empty()) return 1;
  std::printf(
      "all: %.4f panel px RMS, median %.4f, 99th percentile %.4f, %zu blocks (%zu left out)\n",
      rms(all), sizes[sizes.size() / 2], sizes[sizes.size() * 99 / 100], sizes.size(),
      found - sizes.size());
  return 0;
}
