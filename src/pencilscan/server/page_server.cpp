#include "pencilscan/server/page_server.h"

#include <thread>

#include "pencilscan/server/guarded_server.h"

namespace pencilscan {

PageServer::PageServer(const std::string& address, int port, int answers_at_once,
                       const std::string& command)
    : server_(std::make_unique<GuardedServer>(address, answers_at_once)) {
  server_->gate.guard(*server_, port, "only by the link that pencilscan " + command + " prints");
}

PageServer::~PageServer() = default;

int PageServer::port() const { return server_->gate.port(); }
std::string PageServer::link() const { return server_->gate.link(); }
std::string PageServer::answer(const std::string& request) { return server_->answer(request); }

void PageServer::run() {
  running_ = true;
  if (!stopping_) server_->listen_after_bind();
  running_ = false;
}

void PageServer::stop() {
  if (stopping_.exchange(true)) return;
  // cpp-httplib forgets a stop that comes before it listens.
  while (running_ && !server_->is_running()) std::this_thread::yield();
  server_->stop();
}

}  // namespace pencilscan
