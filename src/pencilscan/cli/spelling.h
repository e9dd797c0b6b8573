#pragma once

#include <string>
#include <vector>

namespace pencilscan::cli {

/// "; did you mean X?", X being the candidate with the fewest letters put in, left out, replaced or
/// swapped with their neighbour (Damerau 1964), dashes at the beginning aside; a word that begins
/// like a longer one counts as one letter off. Empty where more than a third of the letters differ:
/// a guess so far off misleads.
[[nodiscard]] std::string did_you_mean(const std::string& word,
                                       const std::vector<std::string>& candidates);

/// "a, b or c".
[[nodiscard]] std::string either(const std::vector<std::string>& words);
/// The words of which either() made the text; they hold no spaces and no commas.
[[nodiscard]] std::vector<std::string> words_of_either(const std::string& text);

}  // namespace pencilscan::cli
