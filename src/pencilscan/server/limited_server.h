#pragma once

#include <string>

#include "pencilscan/server/http.h"

namespace pencilscan {

/// An HTTP server that answers one request a connection, and none that is too long or too slow: the
/// library's own limits are on single lines and single bytes, so that a client that sends one byte
/// every few seconds would hold a thread for ever. Parts of files (Range) are not served.
class LimitedServer : public httplib::Server {
 public:
  static constexpr std::size_t kLongestRequest = 16 * 1024;  ///< bytes of line and headers
  static constexpr double kRequestSeconds = 5;               ///< until all of them are here
  static constexpr double kStallSeconds = 20;  ///< that an answer waits for its reader

  /// The whole answer to the bytes of one request, without a network.
  std::string answer(const std::string& request);

 private:
  bool process_and_close_socket(socket_t socket) override;
  bool serve(httplib::Stream& stream);
};

}  // namespace pencilscan
