#include "pencilscan/server/lab_server.h"

#include <nlohmann/json.hpp>

#include "pencilscan/server/gate.h"
#include "pencilscan/server/lab_page.h"
#include "pencilscan/server/limited_server.h"

namespace pencilscan {
namespace {

constexpr int kLabThreads = 4;

}  // namespace

struct LabServer::State {
  void add_routes();
  void answer_preview(const httplib::Request& request, httplib::Response& response);
  void answer_action(const httplib::Request& request, httplib::Response& response);

  LabDesk* desk = nullptr;
  LimitedServer server;
  Gate gate{"127.0.0.1"};
};

void LabServer::State::answer_preview(const httplib::Request& request,
                                      httplib::Response& response) {
  const std::string digits = request.matches[1];
  std::string picture;
  if (digits.size() < 9) picture = desk->preview(std::stoul(digits));
  if (picture.empty()) return refuse(response, 404, "no picture yet");
  response.set_content(std::move(picture), "image/jpeg");
}

void LabServer::State::answer_action(const httplib::Request& request, httplib::Response& response) {
  std::map<std::string, std::string> values;
  for (const auto& [name, value] : request.params) values[name] = value;
  const std::string why_not = desk->act(request.matches[1], values);
  if (!why_not.empty()) return refuse(response, 409, why_not);
  response.set_content("{}", "application/json");
}

void LabServer::State::add_routes() {
  const std::string root = gate.path();
  server.Get(root, [](const httplib::Request&, httplib::Response& response) {
    response.set_content(kLabPage, "text/html; charset=utf-8");
  });
  server.Get(root + "status", [this](const httplib::Request&, httplib::Response& response) {
    response.set_content(desk->status().dump(), "application/json");
  });
  server.Get(root + R"(preview/(\d+))",
             [this](const auto& request, auto& response) { answer_preview(request, response); });
  server.Post(root + "act/([a-z]+)",
              [this](const auto& request, auto& response) { answer_action(request, response); });
}

LabServer::LabServer(int port) : state_(std::make_unique<State>()) {
  state_->gate.guard(state_->server, port, "only by the link that pencilscan lab prints");
  state_->server.new_task_queue = [] {
    return new httplib::ThreadPool(kLabThreads);  // NOLINT: the server takes it
  };
  state_->add_routes();
}

LabServer::~LabServer() = default;

void LabServer::set_desk(LabDesk& desk) { state_->desk = &desk; }

int LabServer::port() const { return state_->gate.port(); }
std::string LabServer::link() const { return state_->gate.link(); }
std::string LabServer::answer(const std::string& request) { return state_->server.answer(request); }
void LabServer::run() { state_->server.listen_after_bind(); }
void LabServer::stop() { state_->server.stop(); }

}  // namespace pencilscan
