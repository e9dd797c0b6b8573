#pragma once

#include <string>

#include "pencilscan/server/http.h"

namespace pencilscan {

/// Who gets an answer from a server on this computer: requests that name its address, below a path
/// that is random. No other user, program or web page (DNS rebinding) can know it.
class Gate {
 public:
  /// InputError when `address` is not one IPv4 address.
  explicit Gate(const std::string& address);

  /// Takes the port (0: any free one) for the server, for nobody else; answers 403 to who must not
  /// come in; adds the headers that keep pages apart. StageError when the port is not free.
  void guard(httplib::Server& server, int port, const std::string& only_by);

  [[nodiscard]] int port() const { return port_; }
  /// "/<token>/", before all paths.
  [[nodiscard]] std::string path() const { return "/" + token_ + "/"; }
  /// "http://127.0.0.1:40123/<token>/".
  [[nodiscard]] std::string link() const;

 private:
  [[nodiscard]] bool names_this_host(const httplib::Request& request) const;
  [[nodiscard]] bool knows_token(const httplib::Request& request) const;

  std::string address_;
  std::string token_;
  int port_ = 0;
};

/// A refusal in plain text.
void refuse(httplib::Response& response, int status, const std::string& why);

}  // namespace pencilscan
