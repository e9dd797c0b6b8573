#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// What a projector can be asked to show.
struct ProjectorPicture {
  enum class Kind {
    kBlack,
    kWhite,
    kLines,     ///< the patterns of the rig
    kGray,      ///< image `number` of gray_code_sequence()
    kSolid,     ///< an even `color`
    kIdentify,  ///< the projector's name, its output, and a frame along the panel's border
    kColumns,   ///< columns of one pixel, white and black in turn: even grey, unless it is scaled
    kRows,      ///< rows likewise
    kFocus,     ///< fine checks all over the panel, for turning the lens
  };
  Kind kind = Kind::kBlack;
  std::size_t number = 0;
  Rgb color{};

  friend bool operator==(const ProjectorPicture&, const ProjectorPicture&) = default;
};

/// black, white, lines, gray:7, red, grey50 (the names of solid_images()), identify, columns, rows,
/// focus; nothing for another text.
[[nodiscard]] std::optional<ProjectorPicture> picture_from_text(const std::string& text);
[[nodiscard]] std::string to_string(const ProjectorPicture& picture);

/// The picture as the panel gets it: CV_8UC3 in RGB order, width x height of the projector.
/// InputError (field: `source`) when lines are asked of a projector without patterns, or a Gray
/// code beyond its last.
[[nodiscard]] cv::Mat render_picture(const ProjectorPicture& picture, const Projector& projector,
                                     const std::string& source = "rig");

}  // namespace pencilscan
