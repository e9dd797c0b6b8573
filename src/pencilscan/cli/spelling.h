#pragma once

#include <optional>
#include <string>
#include <vector>

namespace pencilscan::cli {

/// The candidate that `word` was meant to be: the one with the fewest letters put in, left out,
/// replaced or swapped with their neighbour (Damerau 1964), dashes at the beginning aside; a word
/// that begins like a longer one counts as one letter off. Nothing where more than a third of the
/// letters differ: a guess so far off misleads.
[[nodiscard]] std::optional<std::string> nearest_word(const std::string& word,
                                                      const std::vector<std::string>& candidates);

/// "; did you mean X?" where there is one, else nothing.
[[nodiscard]] std::string did_you_mean(const std::string& word,
                                       const std::vector<std::string>& candidates);

/// "a, b or c".
[[nodiscard]] std::string either(const std::vector<std::string>& words);
/// The words of which either() made the text; they hold no spaces and no commas.
[[nodiscard]] std::vector<std::string> words_of_either(const std::string& text);

}  // namespace pencilscan::cli
