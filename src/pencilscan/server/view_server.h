#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "pencilscan/page/page.h"

namespace pencilscan {

struct ViewOptions {
  int port = 0;  ///< 0: any free one
  /// An address of this computer. Another one than this is reached from other computers, over a
  /// connection that is not encrypted.
  std::string address = "127.0.0.1";
  PageOptions page;
};

/// Serves the page of one output folder with its full data to who knows the link: below a random
/// token, GET / is the page, part/<result>/<part> its data, list/<result> and files/<path> the
/// files of the folder. Every other path is forbidden, to other users and programs of this computer
/// too. Bound to 127.0.0.1 unless told, and answers only requests that name this host, so that no
/// web page of another origin can reach it (DNS rebinding). Nothing outside of the folder is
/// served. Requests are limited in size and time (limited_server.h).
class ViewServer {
 public:
  /// Finds the results and takes the port. InputError when the folder is none, or the address is
  /// none of this computer; StageError when the port is not free.
  ViewServer(const std::filesystem::path& root, const ViewOptions& options);
  ~ViewServer();

  [[nodiscard]] int port() const;
  /// "http://127.0.0.1:40123/<token>/".
  [[nodiscard]] std::string link() const;
  /// The whole answer to the bytes of one request, without a network: for tests.
  [[nodiscard]] std::string answer(const std::string& request);
  [[nodiscard]] std::size_t results() const;
  /// Answers requests until stop() is called, from another thread.
  void run();
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
