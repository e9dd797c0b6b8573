#pragma once

#include <array>
#include <charconv>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace pencilscan {

/// The values in a struct of options, found by the compiler: a field that is added later is among
/// them without anybody writing it down. The struct has to be an aggregate of at most
/// kMostFields fields, and so have the structs in it.
constexpr std::size_t kMostFields = 20;

namespace fields_detail {

/// Becomes whatever a field is; only in questions to the compiler.
struct Anything {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor): that is what it is for
};

template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...> /*fields*/) {
  return requires { T{(static_cast<void>(I), Anything{})...}; };
}

/// The most values that T can be made of: its fields.
template <class T, std::size_t N = kMostFields>
constexpr std::size_t field_count() {
  if constexpr (takes<T>(std::make_index_sequence<N>())) {
    return N;
  } else {
    static_assert(N > 0);
    return field_count<T, N - 1>();
  }
}

/// References to the fields.
template <class T>
auto tied(const T& value) {
  constexpr std::size_t n = field_count<T>();
  static_assert(!takes<T>(std::make_index_sequence<kMostFields + 1>()), "more than kMostFields");
  // clang-format off
  if constexpr (n == 0) { return std::tuple<>(); }
#define PENCILSCAN_TIE(count, ...) \
  else if constexpr (n == (count)) { const auto& [__VA_ARGS__] = value; return std::tie(__VA_ARGS__); }
  PENCILSCAN_TIE(1, a)
  PENCILSCAN_TIE(2, a, b)
  PENCILSCAN_TIE(3, a, b, c)
  PENCILSCAN_TIE(4, a, b, c, d)
  PENCILSCAN_TIE(5, a, b, c, d, e)
  PENCILSCAN_TIE(6, a, b, c, d, e, f)
  PENCILSCAN_TIE(7, a, b, c, d, e, f, g)
  PENCILSCAN_TIE(8, a, b, c, d, e, f, g, h)
  PENCILSCAN_TIE(9, a, b, c, d, e, f, g, h, i)
  PENCILSCAN_TIE(10, a, b, c, d, e, f, g, h, i, j)
  PENCILSCAN_TIE(11, a, b, c, d, e, f, g, h, i, j, k)
  PENCILSCAN_TIE(12, a, b, c, d, e, f, g, h, i, j, k, l)
  PENCILSCAN_TIE(13, a, b, c, d, e, f, g, h, i, j, k, l, m)
  PENCILSCAN_TIE(14, a, b, c, d, e, f, g, h, i, j, k, l, m, o)
  PENCILSCAN_TIE(15, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p)
  PENCILSCAN_TIE(16, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q)
  PENCILSCAN_TIE(17, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r)
  PENCILSCAN_TIE(18, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, s)
  PENCILSCAN_TIE(19, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, s, t)
  PENCILSCAN_TIE(20, a, b, c, d, e, f, g, h, i, j, k, l, m, o, p, q, r, s, t, u)
#undef PENCILSCAN_TIE
  // clang-format on
}

inline void append(std::string& text, const std::string& value) { text += '"' + value + '"'; }

template <class T>
void append(std::string& text, const T& value);

template <class... Types>
void append(std::string& text, const std::variant<Types...>& value) {
  text += std::to_string(value.index()) + ":";
  std::visit([&](const auto& held) { append(text, held); }, value);
}

template <class T>
void append(std::string& text, const std::optional<T>& value) {
  text += value ? "+" : "-";
  if (value) append(text, *value);
}

/// Two functions cannot be told apart: only whether there is one is said.
template <class Signature>
void append(std::string& text, const std::function<Signature>& value) {
  text += value ? "function" : "none";
}

template <class Values>
void append_all(std::string& text, const Values& values) {
  text += "[";
  for (const auto& value : values) append(text, value);
  text += "]";
}

template <class T>
void append(std::string& text, const std::vector<T>& values) {
  append_all(text, values);
}

template <class T, std::size_t N>
void append(std::string& text, const std::array<T, N>& values) {
  append_all(text, values);
}

template <class T>
void append(std::string& text, const T& value) {
  if constexpr (std::is_enum_v<T>) {
    append(text, static_cast<std::underlying_type_t<T>>(value));
  } else if constexpr (std::is_same_v<T, bool>) {
    text += value ? "yes " : "no ";
  } else if constexpr (std::is_arithmetic_v<T>) {
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text.append(digits.data(), end);
    text += ' ';
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    append(text, value.string());
  } else {
    static_assert(std::is_aggregate_v<T>, "only structs of plain values can be listed");
    text += "{";
    std::apply([&](const auto&... fields) { (append(text, fields), ...); }, tied(value));
    text += "}";
  }
}

}  // namespace fields_detail

/// All values of `options` and of the structs in it, in order. Equal exactly where the values are,
/// but for functions: who has different ones has to tell them apart otherwise.
template <class Options>
[[nodiscard]] std::string fields_text(const Options& options) {
  std::string text;
  fields_detail::append(text, options);
  return text;
}

}  // namespace pencilscan
