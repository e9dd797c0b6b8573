#pragma once

#include <functional>
#include <string>

namespace pencilscan {

/// How a part of a result or an experiment is not as it should be.
enum class Flaw {
  kMissing,
  kUnreadable,
  kDoubtful,  ///< it is there, and can hardly be what it is taken for
  kNote,      ///< a word about what is there
};

/// The word for the page.
[[nodiscard]] inline const char* to_string(Flaw flaw) {
  switch (flaw) {
    case Flaw::kMissing:
      return "missing";
    case Flaw::kUnreadable:
      return "unreadable";
    case Flaw::kDoubtful:
      return "doubtful";
    case Flaw::kNote:
      return "note";
  }
  return "unknown";
}

/// Is told what is not as it should be, and why.
using FlawNote = std::function<void(const std::string& what, const std::string& why, Flaw kind)>;

}  // namespace pencilscan
