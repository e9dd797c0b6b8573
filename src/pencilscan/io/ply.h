#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace pencilscan {

/// One property of a PLY element, as doubles (exact for every PLY type). A list property has the
/// values of all items one after another and `begin[i]..begin[i + 1]` for item i.
struct PlyColumn {
  std::string name;
  bool is_list = false;
  bool is_byte = false;  ///< type uchar
  std::vector<double> values;
  std::vector<std::size_t> begin;  ///< empty for a scalar property
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyColumn> columns;

  [[nodiscard]] const PlyColumn* find(std::string_view column) const;
};

struct PlyFile {
  std::vector<PlyElement> elements;

  [[nodiscard]] const PlyElement* find(std::string_view element) const;
};

/// Reads any PLY: ascii, binary little endian or binary big endian, every element and property.
/// InputError when it is missing, no PLY, or shorter than its header says. Greg Turk, "The PLY
/// Polygon File Format", 1994.
[[nodiscard]] PlyFile read_ply(const std::filesystem::path& path);

}  // namespace pencilscan
