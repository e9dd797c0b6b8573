#pragma once

#include <filesystem>
#include <memory>

#include "pencilscan/page/page.h"

namespace pencilscan {

struct ViewOptions {
  int port = 0;  ///< 0: any free one
  PageOptions page;
};

/// Serves the page of one output folder with its full data to programs on this computer:
/// GET / is the page, /part/<result>/<part> its data, /list/<result> and /files/<path> the files of
/// the folder. Bound to 127.0.0.1 only, and answers only requests that name this host, so that no
/// web page of another origin can reach it (DNS rebinding). Nothing outside of the folder is
/// served.
class ViewServer {
 public:
  /// Finds the results and takes the port. InputError when the folder is none; StageError when the
  /// port is not free.
  ViewServer(const std::filesystem::path& root, const ViewOptions& options);
  ~ViewServer();

  [[nodiscard]] int port() const;
  [[nodiscard]] std::size_t results() const;
  /// Answers requests until stop() is called, from another thread.
  void run();
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
