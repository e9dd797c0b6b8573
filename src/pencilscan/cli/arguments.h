#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "pencilscan/cli/spelling.h"

// What the values of options must be, in words: help shows it, and so does the one line that
// refuses a value. (The library's own rules speak of types and enumerations.)

namespace pencilscan::cli {

/// "= 7: must be a whole number".
[[nodiscard]] inline std::string refusal(const std::string& value, const std::string& rule) {
  return "= " + value + ": must be " + rule;
}

template <class Number>
[[nodiscard]] std::optional<Number> number_of(const std::string& text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || read != end) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(value)) return std::nullopt;
  }
  return value;
}

/// "12" or "0.5", without the zeros behind; a power of ten only where digits would be many.
template <class Number>
[[nodiscard]] std::string number_text(Number value) {
  char text[40];
  if constexpr (std::is_floating_point_v<Number>) {
    if (value == 0 || (std::abs(value) >= 1e-4 && std::abs(value) <= 1e9))
      return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::fixed).ptr};
  }
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// `in_words` is what help shows, and with what kind of number it is the rule of refusals.
template <class Number, class Holds>
[[nodiscard]] CLI::Validator number_that(Holds holds, const std::string& in_words) {
  const std::string kind = std::is_integral_v<Number> ? "a whole number" : "a number";
  const std::string rule = in_words.empty() ? kind : kind + " " + in_words;
  return {[=](std::string& text) {
            const auto value = number_of<Number>(text);
            return value && holds(*value) ? std::string() : refusal(text, rule);
          },
          in_words};
}

template <class Number>
[[nodiscard]] CLI::Validator any_number() {
  return number_that<Number>([](Number) { return true; }, "");
}
template <class Number>
[[nodiscard]] CLI::Validator between(Number low, Number high) {
  return number_that<Number>([=](Number value) { return value >= low && value <= high; },
                             "from " + number_text(low) + " to " + number_text(high));
}
/// An option for a number from `low` to `high`. What `value` has is its default.
template <class Number>
CLI::Option* add_number(CLI::App& command, const std::string& name, Number& value,
                        std::type_identity_t<Number> low, std::type_identity_t<Number> high,
                        const std::string& text) {
  return command.add_option(name, value, text)->check(between(low, high))->capture_default_str();
}
[[nodiscard]] inline CLI::Validator above_zero() {
  return number_that<double>([](double value) { return value > 0; }, "above 0");
}
[[nodiscard]] inline CLI::Validator zero_or_more() {
  return number_that<double>([](double value) { return value >= 0; }, "0 or above");
}

/// The name of rules that list words; what they say is either() of these.
inline constexpr const char* kWordsRule = "words";

/// One of these words.
[[nodiscard]] inline CLI::Validator one_of(const std::vector<std::string>& words) {
  return {[=](std::string& text) {
            for (const std::string& word : words)
              if (text == word) return std::string();
            return refusal(text, either(words)) + did_you_mean(text, words);
          },
          either(words), kWordsRule};
}
/// The same for words that stand for values of an enumeration: for transform(), not check().
template <class Enum>
[[nodiscard]] CLI::Validator choice(const std::map<std::string, Enum>& values) {
  std::vector<std::string> words;
  for (const auto& [word, value] : values) words.push_back(word);
  return {[=](std::string& text) {
            const auto found = values.find(text);
            if (found == values.end())
              return refusal(text, either(words)) + did_you_mean(text, words);
            text = std::to_string(static_cast<int>(found->second));
            return std::string();
          },
          either(words), kWordsRule};
}
/// The words that an option's rule lists: nothing where its values are not words.
[[nodiscard]] std::vector<std::string> listed_words(CLI::Option& option);

// What an option without an effect says. One that asks for output is refused, since whoever gives
// it would miss a file; one that only changes how something is done is told, since scripts give it
// with every method. Where another option has to be there, or must not, the library's needs() and
// excludes() do.

/// For an option that has an effect only where `holds`. That may look at the values of options that
/// were added before it: the library reads them in this order. `rule`: "needs --bits 8".
[[nodiscard]] CLI::Validator only_where(std::function<bool()> holds, const std::string& rule);

/// The same for an option that is told to have no effect, once, and let pass.
[[nodiscard]] CLI::Validator told_where_not(const std::string& option, std::function<bool()> holds,
                                            const std::string& rule);

/// For an option that makes a command do something else: it excludes the others that were added
/// before, but for those that it uses ("--out") and those of every command.
void excludes_all_but(CLI::App& command, CLI::Option& option, const std::set<std::string>& used);

/// InputError that names the file where `option` would replace one.
void refuse_existing(const std::string& option, const std::filesystem::path& file, bool overwrite);

}  // namespace pencilscan::cli
