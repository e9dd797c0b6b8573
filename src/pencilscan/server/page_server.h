#pragma once

#include <atomic>
#include <memory>
#include <string>

namespace pencilscan {

class GuardedServer;

/// What the servers of pages have in common: requests are answered only to who knows the link, are
/// limited in size and time, and every path that is not named is forbidden (gate.h,
/// limited_server.h).
class PageServer {
 public:
  [[nodiscard]] int port() const;
  /// "http://127.0.0.1:40123/<token>/".
  [[nodiscard]] std::string link() const;
  /// The whole answer to the bytes of one request, without a network: for tests.
  [[nodiscard]] std::string answer(const std::string& request);
  /// Answers requests until stop() is called, by another thread, before or meanwhile.
  void run();
  /// Does not wait for run() to end.
  void stop();

 protected:
  /// Takes the port (0: any free one) of an address of this computer. `command`: which prints the
  /// link. InputError when the address is none; StageError when the port is not free.
  PageServer(const std::string& address, int port, int answers_at_once, const std::string& command);
  ~PageServer();

  GuardedServer& server() { return *server_; }

 private:
  std::unique_ptr<GuardedServer> server_;
  std::atomic<bool> running_ = false;
  std::atomic<bool> stopping_ = false;
};

}  // namespace pencilscan
