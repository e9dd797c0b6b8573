#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "pencilscan/server/page_server.h"

namespace pencilscan {

/// A laboratory as its page sees it. Called from several threads at once.
class LabDesk {
 public:
  LabDesk() = default;
  virtual ~LabDesk() = default;
  LabDesk(const LabDesk&) = delete;
  LabDesk& operator=(const LabDesk&) = delete;

  /// Everything the page shows but pictures.
  [[nodiscard]] virtual nlohmann::ordered_json status() = 0;
  /// The camera's last picture as JPEG; empty: there is none.
  [[nodiscard]] virtual std::string preview(std::size_t camera) = 0;
  /// Does, or begins, what somebody pressed a button for. An action is one word of a fixed list;
  /// nothing of it is ever run as a command. Empty, or why it cannot be done.
  [[nodiscard]] virtual std::string act(const std::string& action,
                                        const std::map<std::string, std::string>& values) = 0;
};

/// Serves the page of a laboratory on the loopback interface: below a random token, GET / is the
/// page, GET status and GET preview/<camera> what it shows; POST act/<action> with values in the
/// query is a button.
class LabServer : public PageServer {
 public:
  /// Takes the port (0: any free one), in the network that this process is in now. StageError when
  /// it is not free.
  explicit LabServer(int port);

  /// What is served from now on.
  void set_desk(LabDesk& desk) { desk_ = &desk; }

 private:
  LabDesk* desk_ = nullptr;
};

}  // namespace pencilscan
