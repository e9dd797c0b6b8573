#include "pencilscan/server/lab_server.h"

#include <nlohmann/json.hpp>

#include "pencilscan/io/json_text.h"
#include "pencilscan/server/guarded_server.h"
#include "pencilscan/server/lab_page.h"

namespace pencilscan {
namespace {

constexpr int kLabAnswersAtOnce = 4;

void answer_preview(LabDesk& desk, const httplib::Request& request, httplib::Response& response) {
  const std::string digits = request.matches[1];
  std::string picture;
  if (digits.size() < 9) picture = desk.preview(std::stoul(digits));
  if (picture.empty()) return refuse(response, 404, "no picture yet");
  response.set_content(std::move(picture), "image/jpeg");
}

void answer_action(LabDesk& desk, const httplib::Request& request, httplib::Response& response) {
  std::map<std::string, std::string> values;
  for (const auto& [name, value] : request.params) values[name] = value;
  const std::string why_not = desk.act(request.matches[1], values);
  if (!why_not.empty()) return refuse(response, 409, why_not);
  response.set_content("{}", "application/json");
}

}  // namespace

LabServer::LabServer(int port) : PageServer("127.0.0.1", port, kLabAnswersAtOnce, "lab") {
  const std::string root = server().gate.path();
  server().Get(root, [](const httplib::Request&, httplib::Response& response) {
    response.set_content(kLabPage, "text/html; charset=utf-8");
  });
  server().Get(root + "status", [this](const httplib::Request&, httplib::Response& response) {
    response.set_content(json_line(desk_->status()), "application/json");
  });
  server().Get(root + R"(preview/(\d+))", [this](const auto& request, auto& response) {
    answer_preview(*desk_, request, response);
  });
  server().Post(root + "act/([a-z]+)", [this](const auto& request, auto& response) {
    answer_action(*desk_, request, response);
  });
}

}  // namespace pencilscan
