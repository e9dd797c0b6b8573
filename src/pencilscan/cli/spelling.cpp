#include "pencilscan/cli/spelling.h"

#include <algorithm>
#include <optional>
#include <sstream>

namespace pencilscan::cli {
namespace {

std::string without_dashes(const std::string& word) {
  const auto begin = word.find_first_not_of('-');
  return begin == std::string::npos ? "" : word.substr(begin);
}

/// Distance of optimal string alignment: three rows of the usual table suffice.
std::size_t letters_off(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before_last;
  std::vector<std::size_t> last(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::vector<std::size_t> row(b.size() + 1, i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool same = a[i - 1] == b[j - 1];
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
    before_last = std::move(last);
    last = std::move(row);
  }
  return last.back();
}

bool begins_alike(const std::string& a, const std::string& b) {
  constexpr std::size_t kLeast = 3;  // letters; fewer begin too many words
  return std::min(a.size(), b.size()) >= kLeast && (a.starts_with(b) || b.starts_with(a));
}

/// The candidate of did_you_mean().
std::optional<std::string> nearest_word(const std::string& word,
                                        const std::vector<std::string>& candidates) {
  const std::string typed = without_dashes(word);
  constexpr std::size_t kLongest = 64;  // no word of ours is nearly as long
  if (typed.empty() || typed.size() > kLongest) return std::nullopt;
  std::optional<std::string> best;
  std::size_t least = 0;
  for (const std::string& candidate : candidates) {
    const std::string known = without_dashes(candidate);
    std::size_t off = letters_off(typed, known);
    if (begins_alike(typed, known)) off = std::min<std::size_t>(off, 1);
    const std::size_t limit = std::max<std::size_t>(1, std::max(typed.size(), known.size()) / 3);
    if (off > limit || known.size() <= off || (best && off >= least)) continue;
    best = candidate;
    least = off;
  }
  return best;
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& candidates) {
  const auto nearest = nearest_word(word, candidates);
  return nearest ? "; did you mean " + *nearest + "?" : "";
}

std::string either(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? " or " : ", ";
    text += words[i];
  }
  return text;
}

std::vector<std::string> words_of_either(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) {
    if (word.ends_with(',')) word.pop_back();
    if (word != "or") words.push_back(word);
  }
  return words;
}

}  // namespace pencilscan::cli
