#include "pencilscan/cli/serve.h"

#include <atomic>
#include <iostream>
#include <thread>

namespace pencilscan::cli {

void serve(PageServer& server, Interruption& interruption) {
  std::cerr << "pencilscan: open " << server.link() << " in a browser; Ctrl-C stops\n";
  std::atomic<bool> over = false;
  std::thread serving([&] {
    server.run();
    over = true;
  });
  while (!over && !interruption.within(1)) {
  }
  server.stop();
  serving.join();
}

}  // namespace pencilscan::cli
