#pragma once

#include "pencilscan/server/gate.h"
#include "pencilscan/server/limited_server.h"

namespace pencilscan {

/// A LimitedServer with the Gate before it.
class GuardedServer : public LimitedServer {
 public:
  explicit GuardedServer(const std::string& address) : gate(address) {}

  Gate gate;
};

}  // namespace pencilscan
