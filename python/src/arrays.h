#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pencilscan/api/images.h"

namespace pencilscan::python {

namespace py = pybind11;

/// A view of a field of a vector's elements, to read; `owner` keeps them alive. Shape (n) or
/// (n, columns). Indices among them were checked: nobody may change them behind that check.
template <class Element, class T>
py::array field_view(const std::vector<Element>& values, std::size_t offset, py::ssize_t columns,
                     const py::object& owner) {
  const auto* first = reinterpret_cast<const char*>(values.data()) + offset;
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(values.size())};
  std::vector<py::ssize_t> strides{static_cast<py::ssize_t>(sizeof(Element))};
  if (columns > 0) {
    shape.push_back(columns);
    strides.push_back(sizeof(T));
  }
  if (values.empty()) return py::array(py::dtype::of<T>(), shape);
  py::array view(py::dtype::of<T>(), shape, strides, first, owner);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

/// The pixels of a matrix, shape (rows, columns[, channels]). They stay alive with the array;
/// `owner`, where there is one, keeps those that are not the matrix's own.
py::array matrix_view(const cv::Mat& matrix, py::object owner = {});

/// A picture where it lies in an array of uint8, uint16 or float32; what NumPy stores otherwise is
/// copied into `kept` first. `argument` and `name` are the picture's in an InputError.
ImageView picture(const std::string& argument, const std::string& name, const py::handle& array,
                  std::vector<py::array>& kept);

}  // namespace pencilscan::python
