#include "pencilscan/display/projector_picture.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/pattern/gray_code.h"
#include "pencilscan/pattern/solid_color.h"

namespace pencilscan {
namespace {

using Kind = ProjectorPicture::Kind;

struct NamedKind {
  const char* name;
  Kind kind;
};
constexpr std::array<NamedKind, 7> kNames{{{"black", Kind::kBlack},
                                           {"white", Kind::kWhite},
                                           {"lines", Kind::kLines},
                                           {"identify", Kind::kIdentify},
                                           {"columns", Kind::kColumns},
                                           {"rows", Kind::kRows},
                                           {"focus", Kind::kFocus}}};

const cv::Scalar kInk(255, 255, 255);
const cv::Scalar kFrame(255, 160, 0);

/// Text centred at a row, as wide as a share of the panel.
void put_centred(cv::Mat& panel, const std::string& text, int row, double share) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  int below = 0;
  const cv::Size unit = cv::getTextSize(text, kFont, 1, 2, &below);
  const double scale = std::min(share * panel.cols / std::max(1, unit.width),
                                0.25 * panel.rows / std::max(1, unit.height));
  const int thick = std::max(1, static_cast<int>(2 * scale));
  const cv::Size size = cv::getTextSize(text, kFont, scale, thick, &below);
  cv::putText(panel, text, {(panel.cols - size.width) / 2, row + size.height / 2}, kFont, scale,
              kInk, thick, cv::LINE_AA);
}

/// The outermost pixels are drawn, so that a picture that is cut off or scaled is seen.
cv::Mat identify_picture(const Projector& projector) {
  cv::Mat panel(projector.height, projector.width, CV_8UC3, cv::Scalar::all(0));
  cv::rectangle(panel, {0, 0, panel.cols, panel.rows}, kInk, 1);
  cv::rectangle(panel, {4, 4, panel.cols - 8, panel.rows - 8}, kFrame, 2);
  const int corner = std::max(8, panel.rows / 12);
  const std::array<cv::Scalar, 4> colors{cv::Scalar(255, 0, 0), cv::Scalar(0, 255, 0),
                                         cv::Scalar(0, 0, 255), cv::Scalar(255, 255, 255)};
  for (int k = 0; k < 4; ++k) {
    const int x = k % 2 == 0 ? 12 : panel.cols - 12 - corner;
    const int y = k < 2 ? 12 : panel.rows - 12 - corner;
    cv::rectangle(panel, {x, y, corner, corner}, colors[static_cast<std::size_t>(k)], cv::FILLED);
  }
  put_centred(panel, projector.name, panel.rows * 2 / 5, 0.7);
  const std::string output = projector.output.empty() ? "" : projector.output + "   ";
  put_centred(panel, output + size_text(projector.width, projector.height), panel.rows * 3 / 5,
              0.5);
  put_centred(panel, "top", panel.rows / 8, 0.06);
  return panel;
}

cv::Mat stripes(const Projector& projector, bool columns) {
  cv::Mat panel(projector.height, projector.width, CV_8UC3, cv::Scalar::all(0));
  for (int i = 0; i < (columns ? panel.cols : panel.rows); i += 2)
    (columns ? panel.col(i) : panel.row(i)).setTo(cv::Scalar::all(255));
  return panel;
}

cv::Mat focus_picture(const Projector& projector) {
  constexpr int kCheck = 4;  // px: some camera pixels, where cameras and projectors are alike
  cv::Mat panel(projector.height, projector.width, CV_8UC3, cv::Scalar::all(0));
  for (int y = 0; y < panel.rows; ++y)
    for (int x = 0; x < panel.cols; ++x)
      if ((x / kCheck + y / kCheck) % 2 == 0) panel.at<cv::Vec3b>(y, x) = {255, 255, 255};
  return panel;
}

cv::Mat as_bytes(const cv::Mat& light) {
  cv::Mat bytes;
  light.convertTo(bytes, CV_8U, 255);
  return bytes;
}

cv::Mat gray_picture(std::size_t number, const Projector& projector, const std::string& source) {
  const auto sequence = gray_code_sequence(projector.width, projector.height);
  if (number >= sequence.size())
    throw InputError(source, "gray", std::to_string(number),
                     "must be below " + std::to_string(sequence.size()) + " for " + projector.name);
  cv::Mat panel;
  cv::cvtColor(render_gray_code(sequence[number], projector.width, projector.height), panel,
               cv::COLOR_GRAY2RGB);
  return panel;
}

}  // namespace

std::optional<ProjectorPicture> picture_from_text(const std::string& text) {
  for (const NamedKind& entry : kNames)
    if (text == entry.name) return ProjectorPicture{entry.kind, 0, {}};
  for (const SolidImage& solid : solid_images())
    if (text == solid.name) return ProjectorPicture{Kind::kSolid, 0, solid.value};
  constexpr std::string_view kGray = "gray:";
  if (!text.starts_with(kGray)) return std::nullopt;
  ProjectorPicture picture{Kind::kGray, 0, {}};
  const char* first = text.data() + kGray.size();
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(first, last, picture.number);
  if (error != std::errc() || end != last) return std::nullopt;
  return picture;
}

std::string to_string(const ProjectorPicture& picture) {
  if (picture.kind == Kind::kGray) return "gray:" + std::to_string(picture.number);
  for (const NamedKind& entry : kNames)
    if (picture.kind == entry.kind) return entry.name;
  for (const SolidImage& solid : solid_images())
    if (picture.color == solid.value) return solid.name;
  return "solid";
}

cv::Mat render_picture(const ProjectorPicture& picture, const Projector& projector,
                       const std::string& source) {
  const auto even = [&](const Rgb& color) {
    return as_bytes(cv::Mat(projector.height, projector.width, CV_32FC3,
                            cv::Scalar(color[0], color[1], color[2])));
  };
  switch (picture.kind) {
    case Kind::kBlack:
      return even({0, 0, 0});
    case Kind::kWhite:
      return even({1, 1, 1});
    case Kind::kSolid:
      return even(picture.color);
    case Kind::kGray:
      return gray_picture(picture.number, projector, source);
    case Kind::kIdentify:
      return identify_picture(projector);
    case Kind::kColumns:
      return stripes(projector, true);
    case Kind::kRows:
      return stripes(projector, false);
    case Kind::kFocus:
      return focus_picture(projector);
    case Kind::kLines:
      break;
  }
  if (projector.patterns.empty())
    throw InputError(source, projector.name + ".pattern", "",
                     "this key is missing: there are no lines to show");
  return as_bytes(render_patterns(projector.patterns, projector.width, projector.height));
}

}  // namespace pencilscan
