#pragma once

#include <stdexcept>
#include <string>

namespace pencilscan {

/// Input that breaks a rule: the program exits with 2 and this one line.
struct InputError : std::runtime_error {
  InputError(std::string path, std::string field, std::string value, std::string rule);

  std::string path;   ///< the file or option at fault
  std::string field;  ///< where inside it; may be empty
  std::string value;  ///< what stands there; may be empty
  std::string rule;   ///< what must hold
};

/// A stage that could not produce its result (or a full disk): the program exits with 1.
struct StageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace pencilscan
