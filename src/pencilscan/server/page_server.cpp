#include "pencilscan/server/page_server.h"

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
void PageServer::run() { server_->listen_after_bind(); }
void PageServer::stop() { server_->stop(); }

}  // namespace pencilscan
