#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "pencilscan/page/page.h"
#include "pencilscan/server/page_server.h"

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
/// files of the folder. Bound to 127.0.0.1 unless told. Nothing outside of the folder is served.
class ViewServer : public PageServer {
 public:
  /// Takes the port and finds the results, once: what is made later is in the page of another one.
  /// InputError when the folder is none or holds none, or the address is none of this computer;
  /// StageError when the port is not free.
  ViewServer(const std::filesystem::path& root, const ViewOptions& options);
  ~ViewServer();

  [[nodiscard]] std::size_t results() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pencilscan
