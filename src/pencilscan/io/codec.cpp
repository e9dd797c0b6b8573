#include "pencilscan/io/codec.h"

#include <dlfcn.h>

#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

// Of the overloads in OpenCV's header those that are called: it does not compile when they change.
using Decode = decltype(static_cast<cv::Mat (*)(cv::InputArray, int)>(&cv::imdecode));
using Encode = decltype(static_cast<bool (*)(const cv::String&, cv::InputArray, std::vector<uchar>&,
                                             const std::vector<int>&)>(&cv::imencode));

/// OpenCV's codecs. Behind them are GDAL and a hundred more libraries, most of the time that a
/// program needs to start when it is linked with them, and many commands read PNG alone, or
/// nothing. So they are loaded when the first picture needs them.
class Codecs {
 public:
  Codecs() : library_(dlopen(PENCILSCAN_IMGCODECS, RTLD_LAZY | RTLD_LOCAL)) {
    if (library_ == nullptr) {
      const std::string reason = dlerror();
      if (reason.find("failed to map segment") != std::string::npos) throw std::bad_alloc();
      throw StageError("OpenCV's codecs cannot be loaded: " + reason);
    }
    decode = reinterpret_cast<Decode>(symbol("_ZN2cv8imdecodeERKNS_11_InputArrayEi"));
    encode = reinterpret_cast<Encode>(symbol(
        "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKNS_11_InputArrayE"
        "RSt6vectorIhSaIhEERKSB_IiSaIiEE"));
  }

  Decode decode;
  Encode encode;

 private:
  void* symbol(const char* name) const {
    void* found = dlsym(library_, name);
    if (found == nullptr) throw StageError("OpenCV's codecs lack " + std::string(name));
    return found;
  }

  void* library_;  ///< stays loaded
};

const Codecs& codecs() {
  static const Codecs loaded;
  return loaded;
}

}  // namespace

void load_codecs() { codecs(); }

cv::Mat decoded_picture(std::string_view bytes, int flags) {
  const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8UC1,
                        const_cast<char*>(bytes.data()));  // NOLINT: imdecode only reads
  cv::Mat picture;
  const Decode decode = codecs().decode;
  try {
    picture = decode(encoded, flags);
  } catch (const cv::Exception&) {
    return {};
  }
  // What is damaged behind its header decodes to nothing, of three channels all the same.
  if (picture.empty()) return {};
  // Of other depths OpenCV changes no colours.
  if (picture.depth() != CV_8U && picture.depth() != CV_16U && picture.depth() != CV_32F)
    return picture;
  if (picture.channels() == 4) cv::cvtColor(picture, picture, cv::COLOR_BGRA2RGBA);
  if (picture.channels() == 3) cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return picture;
}

std::string encoded_picture(const cv::Mat& picture, const std::string& ending,
                            const std::vector<int>& parameters) {
  cv::Mat bgr = picture;
  if (picture.channels() == 3) {
    bgr = cv::Mat();  // of its own: the caller keeps his picture
    cv::cvtColor(picture, bgr, cv::COLOR_RGB2BGR);
  }
  const Encode encode = codecs().encode;
  std::vector<unsigned char> bytes;
  try {
    if (!encode(ending, bgr, bytes, parameters))
      throw StageError("a picture cannot be encoded as " + ending);
  } catch (const cv::Exception& error) {
    throw StageError("a picture cannot be encoded as " + ending + ": " + error.err);
  }
  return {bytes.begin(), bytes.end()};
}

}  // namespace pencilscan
