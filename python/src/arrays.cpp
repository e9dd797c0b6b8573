#include "arrays.h"

#include "pencilscan/core/error.h"

namespace pencilscan::python {
namespace {

/// OpenCV's depth of a NumPy type; -1 for others.
int depth_of(const py::dtype& type) {
  if (!type.attr("isnative").cast<bool>()) return -1;
  if (type.kind() == 'u' && type.itemsize() == 1) return CV_8U;
  if (type.kind() == 'u' && type.itemsize() == 2) return CV_16U;
  if (type.kind() == 'f' && type.itemsize() == 4) return CV_32F;
  return -1;
}

py::dtype dtype_of(int depth) {
  switch (depth) {
    case CV_8U:
      return py::dtype::of<std::uint8_t>();
    case CV_16U:
      return py::dtype::of<std::uint16_t>();
    default:
      return py::dtype::of<float>();
  }
}

/// Pixels of a row follow each other, and rows do not overlap: what cv::Mat can point to.
bool is_row_by_row(const py::array& array) {
  const py::ssize_t item = array.itemsize();
  const py::ssize_t channels = array.ndim() == 3 ? array.shape(2) : 1;
  if (array.ndim() == 3 && channels > 1 && array.strides(2) != item) return false;
  return array.strides(1) == item * channels &&
         array.strides(0) >= item * channels * array.shape(1) && array.strides(0) % item == 0;
}

std::string shape_text(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t k = 0; k < array.ndim(); ++k)
    text += (k > 0 ? ", " : "") + std::to_string(array.shape(k));
  return text + ")";
}

}  // namespace

py::array matrix_view(const cv::Mat& matrix, py::object owner) {
  const py::dtype type = dtype_of(matrix.depth());
  std::vector<py::ssize_t> shape{matrix.rows, matrix.cols};
  std::vector<py::ssize_t> strides{static_cast<py::ssize_t>(matrix.step[0]),
                                   static_cast<py::ssize_t>(matrix.elemSize())};
  if (matrix.channels() > 1) {
    shape.push_back(matrix.channels());
    strides.push_back(static_cast<py::ssize_t>(matrix.elemSize1()));
  }
  if (!owner) {
    owner =
        py::capsule(new cv::Mat(matrix), [](void* kept) { delete static_cast<cv::Mat*>(kept); });
  }
  return py::array(type, shape, strides, matrix.data, owner);
}

ImageView picture(const std::string& argument, const std::string& name, const py::handle& object,
                  std::vector<py::array>& kept) {
  py::array array = py::array::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw InputError(argument, name, std::string(py::str(py::type::of(object))),
                     "must be a NumPy array");
  }
  const bool has_shape =
      array.ndim() == 2 || (array.ndim() == 3 && (array.shape(2) == 1 || array.shape(2) == 3));
  if (!has_shape || array.size() == 0) {
    throw InputError(argument, name, "shape " + shape_text(array),
                     "must be (height, width) or (height, width, 3), RGB");
  }
  if (array.dtype().kind() == 'f' && array.itemsize() == 8) array = array.attr("astype")("float32");
  const int depth = depth_of(array.dtype());
  if (depth < 0) {
    throw InputError(argument, name, std::string(py::str(array.dtype())),
                     "must be uint8 or uint16, or float32 in [0, 1]");
  }
  if (!is_row_by_row(array)) array = array.attr("copy")("C");
  kept.push_back(array);
  const int channels = array.ndim() == 3 ? static_cast<int>(array.shape(2)) : 1;
  return cv::Mat(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)),
                 CV_MAKETYPE(depth, channels), const_cast<void*>(array.data()),
                 static_cast<std::size_t>(array.strides(0)));
}

}  // namespace pencilscan::python
