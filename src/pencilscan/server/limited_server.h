#pragma once

#include <semaphore>
#include <string>

#include "pencilscan/server/http.h"

namespace pencilscan {

/// An HTTP server that answers one request a connection, and none that is too long or too slow: the
/// library's own limits are on single lines and single bytes, so that a client that sends one byte
/// every few seconds would hold a thread for ever. Parts of files (Range) are not served: who asks
/// for one gets the whole.
class LimitedServer : public httplib::Server {
 public:
  /// Connections that are listened to at once. A thread that waits for its client costs nothing,
  /// and with many of them, clients that say nothing keep nobody out.
  static constexpr int kConnections = 32;
  static constexpr std::size_t kLongestRequest = 16 * 1024;  ///< bytes of line and headers
  static constexpr double kFirstByteSeconds = 1;             ///< until the first of them is here
  static constexpr double kRequestSeconds = 5;               ///< until all of them are here
  static constexpr double kStallSeconds = 20;  ///< that an answer waits for its reader

  /// Makes as many answers at once, of all connections.
  explicit LimitedServer(int answers_at_once);

  /// The whole answer to the bytes of one request, without a network.
  std::string answer(const std::string& request);

 private:
  bool process_and_close_socket(socket_t socket) override;
  bool serve(httplib::Stream& stream);

  std::counting_semaphore<kConnections> answers_;
};

}  // namespace pencilscan
