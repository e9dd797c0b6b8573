#pragma once

#include <ostream>
#include <string>

namespace pencilscan {

/// Something wrong in a laboratory, by name.
struct Fault {
  std::string kind;    ///< one short word for programs: "covered", "lost_packets", ...
  std::string device;  ///< whose
  std::string what;    ///< one sentence
  std::string advice;  ///< what to do; may be empty
};

/// "device: what".
[[nodiscard]] inline std::string to_string(const Fault& fault) {
  return fault.device.empty() ? fault.what : fault.device + ": " + fault.what;
}

inline std::ostream& operator<<(std::ostream& stream, const Fault& fault) {
  return stream << fault.kind << " " << to_string(fault);
}

}  // namespace pencilscan
