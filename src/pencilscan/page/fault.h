#pragma once

#include <functional>
#include <string>

namespace pencilscan {

/// How a part of a result or an experiment is not as it should be.
enum class Fault {
  kMissing,
  kUnreadable,
  kDoubtful,  ///< it is there, and can hardly be what it is taken for
  kNote,      ///< a word about what is there
};

/// The word for the page.
[[nodiscard]] inline const char* to_string(Fault fault) {
  switch (fault) {
    case Fault::kMissing:
      return "missing";
    case Fault::kUnreadable:
      return "unreadable";
    case Fault::kDoubtful:
      return "doubtful";
    case Fault::kNote:
      return "note";
  }
  return "unknown";
}

/// Is told what is not as it should be, and why.
using FaultNote = std::function<void(const std::string& what, const std::string& why, Fault kind)>;

}  // namespace pencilscan
