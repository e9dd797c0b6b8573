#pragma once

#include <string>

#include "pencilscan/core/error.h"

namespace pencilscan {

/// For tests: what the InputError of a call says; empty when nothing was thrown.
template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace pencilscan
