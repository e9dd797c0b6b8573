#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pencilscan {

/// How floats become 16-bit steps: evenly, or evenly in their logarithm (for values > 0).
enum class Steps { kLinear, kLogarithmic };

/// Named arrays for the browser, small when compressed. Layout before compression: length of the
/// header (uint32, little endian), the header (JSON), the arrays one after another. An array of
/// 16- or 32-bit numbers holds the zigzag-coded differences of neighbours, split into planes of
/// bytes: first all lowest bytes, then all next ones. web/src/block.ts reads it.
class Block {
 public:
  /// A value in the header.
  void put(const std::string& key, nlohmann::ordered_json value);
  void add_bytes(const std::string& name, std::span<const std::uint8_t> values);
  void add_integers(const std::string& name, std::span<const std::uint16_t> values);
  void add_integers(const std::string& name, std::span<const std::uint32_t> values);
  /// Floats over their own range in 2^bits - 2 steps, which makes an error of up to half a step;
  /// 65535 stands for "no value" (not finite, or not positive where logarithmic). 2 <= bits <= 16:
  /// fewer take less room.
  void add_floats(const std::string& name, std::span<const float> values,
                  Steps steps = Steps::kLinear, int bits = 16);

  /// The whole, compressed (zlib, RFC 1950).
  [[nodiscard]] std::string bytes() const;

 private:
  void describe(const std::string& name, const char* type, std::size_t count,
                nlohmann::ordered_json more = {});

  nlohmann::ordered_json header_ = {{"arrays", nlohmann::ordered_json::object()}};
  std::string data_;
};

/// zlib-compressed bytes.
[[nodiscard]] std::string compress(std::string_view bytes);
/// RFC 4648, with padding.
[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace pencilscan
