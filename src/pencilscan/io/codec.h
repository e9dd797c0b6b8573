#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace pencilscan {

/// Loads OpenCV's codecs, which the functions below do when they are first called. For those who
/// cannot wait then: it takes some tenths of a second, on a busy machine one or two.
/// @throws StageError where they cannot be loaded.
void load_codecs();

/// The picture that `bytes` hold (PNG, TIFF, JPEG, BMP, WebP), as OpenCV decodes it with `flags`
/// (cv::ImreadModes). Of 8 or 16 bit or float it is grey, RGB or RGBA; of other depths (signed, of
/// 32 bit, double) as OpenCV has it. Empty where the bytes hold none.
/// @throws StageError where the codecs cannot be loaded.
cv::Mat decoded_picture(std::string_view bytes, int flags);

/// `picture` (grey or RGB, 8 or 16 bit; float for .tiff) as a file with that ending (".png", ...).
/// `parameters` are pairs of cv::ImwriteFlags and their values.
/// @throws StageError where it cannot be encoded or the codecs cannot be loaded.
std::string encoded_picture(const cv::Mat& picture, const std::string& ending,
                            const std::vector<int>& parameters = {});

}  // namespace pencilscan
