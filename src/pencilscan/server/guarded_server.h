#pragma once

#include "pencilscan/server/gate.h"
#include "pencilscan/server/limited_server.h"

namespace pencilscan {

/// A LimitedServer with the Gate before it.
class GuardedServer : public LimitedServer {
 public:
  GuardedServer(const std::string& address, int answers_at_once)
      : LimitedServer(answers_at_once), gate(address) {}

  Gate gate;
};

}  // namespace pencilscan
