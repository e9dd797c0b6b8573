#include "pencilscan/io/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <sstream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"

namespace pencilscan {
namespace {

enum class Encoding { kAscii, kLittleEndian, kBigEndian };

/// A number type of the format. `kind`: i(nteger), u(nsigned), f(loat).
struct NumberType {
  char kind = 'f';
  std::size_t size = 4;  ///< bytes
};

std::optional<NumberType> type_from_name(std::string_view name) {
  if (name == "char" || name == "int8") return NumberType{'i', 1};
  if (name == "uchar" || name == "uint8") return NumberType{'u', 1};
  if (name == "short" || name == "int16") return NumberType{'i', 2};
  if (name == "ushort" || name == "uint16") return NumberType{'u', 2};
  if (name == "int" || name == "int32") return NumberType{'i', 4};
  if (name == "uint" || name == "uint32") return NumberType{'u', 4};
  if (name == "float" || name == "float32") return NumberType{'f', 4};
  if (name == "double" || name == "float64") return NumberType{'f', 8};
  return std::nullopt;
}

struct ColumnTypes {
  NumberType count;  ///< of a list's length
  NumberType value;
};

struct Header {
  Encoding encoding = Encoding::kAscii;
  PlyFile file;                                 ///< without values
  std::vector<std::vector<ColumnTypes>> types;  ///< per element and column
  std::size_t end = 0;                          ///< offset of the first byte after the header
};

/// Reads numbers one after another out of the body.
class Body {
 public:
  Body(const std::string& path, std::string_view bytes, Encoding encoding)
      : path_(path), bytes_(bytes), encoding_(encoding) {}

  double next(NumberType type) {
    return encoding_ == Encoding::kAscii ? next_word() : next_binary(type);
  }
  /// Smallest number of bytes that a value needs, to reject absurd counts before allocating.
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - at_; }

  [[noreturn]] void truncated() const {
    throw InputError(path_, "", "", "truncated PLY: it is shorter than its header says");
  }

 private:
  template <class T>
  double take() {
    if (remaining() < sizeof(T)) truncated();
    std::array<unsigned char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    const bool big = encoding_ == Encoding::kBigEndian;
    if (big != (std::endian::native == std::endian::big)) std::reverse(bytes.begin(), bytes.end());
    return static_cast<double>(std::bit_cast<T>(bytes));
  }

  double next_binary(NumberType type) {
    switch (type.size) {
      case 1:
        return type.kind == 'i' ? take<std::int8_t>() : take<std::uint8_t>();
      case 2:
        return type.kind == 'i' ? take<std::int16_t>() : take<std::uint16_t>();
      case 4:
        if (type.kind == 'f') return take<float>();
        return type.kind == 'i' ? take<std::int32_t>() : take<std::uint32_t>();
      default:
        return take<double>();
    }
  }

  double next_word() {
    const std::string_view blanks = " \t\r\n";
    const auto first = bytes_.find_first_not_of(blanks, at_);
    if (first == std::string_view::npos) truncated();
    auto last = bytes_.find_first_of(blanks, first);
    if (last == std::string_view::npos) last = bytes_.size();
    at_ = last;
    std::string_view word = bytes_.substr(first, last - first);
    if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
    double value = 0;
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (result.ec != std::errc{} || result.ptr != word.data() + word.size()) {
      throw InputError(path_, "", std::string(word.substr(0, 40)), "must be a number");
    }
    return value;
  }

  std::string path_;
  std::string_view bytes_;
  Encoding encoding_;
  std::size_t at_ = 0;
};

class HeaderParser {
 public:
  HeaderParser(std::string path, std::string_view bytes) : path_(std::move(path)), bytes_(bytes) {}

  Header parse() {
    if (next_line() != "ply") fail("", "must be a PLY file (first line `ply`)");
    for (;;) {
      const std::string line = next_line();
      std::istringstream words(line);
      std::string keyword;
      words >> keyword;
      if (keyword == "end_header") break;
      if (keyword == "format") {
        parse_format(line, words);
      } else if (keyword == "element") {
        parse_element(line, words);
      } else if (keyword == "property") {
        parse_property(line, words);
      } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
        fail(line, "unknown line in the PLY header");
      }
    }
    header_.end = at_;
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(const std::string& line, const char* rule) const {
    throw InputError(path_, line.empty() ? "" : "header", line.substr(0, 60), rule);
  }

  std::string next_line() {
    const auto end = bytes_.find('\n', at_);
    if (end == std::string_view::npos || end - at_ > 4096)
      fail("", "must be a PLY file with a whole header");
    std::string line(bytes_.substr(at_, end - at_));
    at_ = end + 1;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
  }

  void parse_format(const std::string& line, std::istringstream& words) {
    std::string encoding;
    words >> encoding;
    if (encoding == "ascii") {
      header_.encoding = Encoding::kAscii;
    } else if (encoding == "binary_little_endian") {
      header_.encoding = Encoding::kLittleEndian;
    } else if (encoding == "binary_big_endian") {
      header_.encoding = Encoding::kBigEndian;
    } else {
      fail(line, "the format must be ascii, binary_little_endian or binary_big_endian");
    }
  }

  void parse_element(const std::string& line, std::istringstream& words) {
    PlyElement element;
    long long count = -1;
    words >> element.name >> count;
    if (!words || count < 0) fail(line, "must be `element <name> <count>`");
    element.count = static_cast<std::size_t>(count);
    header_.file.elements.push_back(std::move(element));
    header_.types.emplace_back();
  }

  void parse_property(const std::string& line, std::istringstream& words) {
    if (header_.file.elements.empty()) fail(line, "a property must follow an element");
    std::string type, count_type = "uchar";
    PlyColumn column;
    words >> type;
    if (type == "list") {
      column.is_list = true;
      words >> count_type >> type;
    }
    words >> column.name;
    const auto value = type_from_name(type);
    const auto count = type_from_name(count_type);
    if (!words || !value || !count) fail(line, "must be `property <type> <name>`");
    column.is_byte = value->kind == 'u' && value->size == 1;
    header_.file.elements.back().columns.push_back(std::move(column));
    header_.types.back().push_back({*count, *value});
  }

  std::string path_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  Header header_;
};

void read_list(Body& body, const ColumnTypes& types, PlyColumn& column) {
  const double length = body.next(types.count);
  // Every value takes at least one byte: a longer list cannot be in the file.
  if (!(length >= 0) || length > static_cast<double>(body.remaining())) body.truncated();
  for (std::size_t k = 0; k < static_cast<std::size_t>(length); ++k) {
    column.values.push_back(body.next(types.value));
  }
  column.begin.push_back(column.values.size());
}

void read_element(Body& body, const std::vector<ColumnTypes>& types, PlyElement& element) {
  // Every property of every item takes at least one byte.
  if (!element.columns.empty() && element.count > body.remaining() / element.columns.size()) {
    body.truncated();
  }
  for (PlyColumn& column : element.columns) {
    if (column.is_list) {
      column.begin.reserve(element.count + 1);
      column.begin.assign(1, 0);
      column.values.reserve(std::min(3 * element.count, body.remaining()));  // mostly triangles
    } else {
      column.values.reserve(element.count);
    }
  }
  if (element.columns.empty()) return;
  for (std::size_t i = 0; i < element.count; ++i) {
    for (std::size_t c = 0; c < types.size(); ++c) {
      PlyColumn& column = element.columns[c];
      if (column.is_list) {
        read_list(body, types[c], column);
      } else {
        column.values.push_back(body.next(types[c].value));
      }
    }
  }
}

}  // namespace

const PlyColumn* PlyElement::find(std::string_view column) const {
  for (const PlyColumn& candidate : columns) {
    if (candidate.name == column) return &candidate;
  }
  return nullptr;
}

const PlyElement* PlyFile::find(std::string_view element) const {
  for (const PlyElement& candidate : elements) {
    if (candidate.name == element) return &candidate;
  }
  return nullptr;
}

PlyFile read_ply(const std::filesystem::path& path) {
  const std::string bytes = read_file(path);
  Header header = HeaderParser(path.string(), bytes).parse();
  Body body(path.string(), std::string_view(bytes).substr(header.end), header.encoding);
  for (std::size_t e = 0; e < header.file.elements.size(); ++e) {
    const PlyElement& element = header.file.elements[e];
    // Nothing in the file would justify the number.
    if (element.columns.empty() && element.count > 0)
      throw InputError(path.string(), "element " + element.name, std::to_string(element.count),
                       "must have properties");
    read_element(body, header.types[e], header.file.elements[e]);
  }
  return std::move(header.file);
}

}  // namespace pencilscan
