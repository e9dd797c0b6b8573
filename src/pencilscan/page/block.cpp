#include "pencilscan/page/block.h"

#include <zlib.h>

#include <cmath>
#include <limits>

#include "pencilscan/core/check.h"
#include "pencilscan/io/little_endian.h"

namespace pencilscan {
namespace {

/// Differences of neighbours, zigzag-coded (0, -1, 1, -2, ... become 0, 1, 2, 3, ...), as planes.
template <class T>
std::string difference_planes(std::span<const T> values) {
  constexpr int kBits = 8 * sizeof(T);
  std::vector<T> codes(values.size());
  T last = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const T difference = static_cast<T>(values[i] - last);  // modulo 2^bits
    const bool negative = (difference >> (kBits - 1)) != 0;
    codes[i] = static_cast<T>((difference << 1) ^ (negative ? static_cast<T>(~T{0}) : T{0}));
    last = values[i];
  }
  std::string planes;
  planes.reserve(values.size() * sizeof(T));
  for (std::size_t plane = 0; plane < sizeof(T); ++plane) {
    for (const T code : codes) planes.push_back(static_cast<char>((code >> (8 * plane)) & 0xFFU));
  }
  return planes;
}

}  // namespace

void Block::put(const std::string& key, nlohmann::ordered_json value) {
  header_[key] = std::move(value);
}

void Block::describe(const std::string& name, const char* type, std::size_t count,
                     nlohmann::ordered_json more) {
  nlohmann::ordered_json entry = {{"type", type}, {"count", count}, {"at", data_.size()}};
  if (more.is_object()) entry.update(more);
  header_["arrays"][name] = std::move(entry);
}

void Block::add_bytes(const std::string& name, std::span<const std::uint8_t> values) {
  describe(name, "u8", values.size());
  for (const std::uint8_t value : values) data_.push_back(static_cast<char>(value));
}

void Block::add_integers(const std::string& name, std::span<const std::uint16_t> values) {
  describe(name, "u16", values.size());
  data_ += difference_planes(values);
}

void Block::add_integers(const std::string& name, std::span<const std::uint32_t> values) {
  describe(name, "u32", values.size());
  data_ += difference_planes(values);
}

void Block::add_floats(const std::string& name, std::span<const float> values, Steps steps,
                       int bits) {
  PENCILSCAN_CHECK(bits >= 2 && bits <= 16);
  const bool logarithmic = steps == Steps::kLogarithmic;
  const auto value_of = [&](float value) {
    if (!logarithmic) return static_cast<double>(value);
    return value > 0 ? std::log(static_cast<double>(value))
                     : std::numeric_limits<double>::quiet_NaN();
  };
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const float value : values) {
    const double x = value_of(value);
    if (!std::isfinite(x)) continue;
    low = std::min(low, x);
    high = std::max(high, x);
  }
  if (!(low <= high)) low = high = 0;
  const double last = (1 << bits) - 2;
  const double step = high > low ? (high - low) / last : 1.0;
  std::vector<std::uint16_t> codes;
  codes.reserve(values.size());
  for (const float value : values) {
    const double x = value_of(value);
    codes.push_back(std::isfinite(x) ? static_cast<std::uint16_t>(std::lround((x - low) / step))
                                     : std::uint16_t{65535});
  }
  describe(name, "f16", codes.size(), {{"low", low}, {"step", step}, {"logarithmic", logarithmic}});
  data_ += difference_planes<std::uint16_t>(codes);
}

std::string Block::bytes() const {
  const std::string header = header_.dump();
  std::string whole;
  append_little_endian(whole, static_cast<std::uint32_t>(header.size()));
  whole += header;
  whole += data_;
  return compress(whole);
}

std::string compress(std::string_view bytes) {
  constexpr int kLevel = 6;  // beyond it, time grows and size hardly shrinks
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string result(size, '\0');
  const int status = compress2(reinterpret_cast<Bytef*>(result.data()), &size,
                               reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), kLevel);
  PENCILSCAN_CHECK(status == Z_OK);
  result.resize(size);
  return result;
}

std::string base64(std::string_view bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const bool padding = i + k > bytes.size();
      text.push_back(padding ? '=' : kDigits[(group >> (18 - 6 * k)) & 63U]);
    }
  }
  return text;
}

}  // namespace pencilscan
