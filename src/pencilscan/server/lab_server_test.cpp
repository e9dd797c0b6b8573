#include "pencilscan/server/lab_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "pencilscan/server/http.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

/// Notes what was pressed.
class NotingDesk final : public LabDesk {
 public:
  nlohmann::ordered_json status() override { return {{"poses", 3}, {"folder", "\xe9"}}; }
  std::string preview(std::size_t camera) override { return camera == 1 ? "JPEG" : ""; }
  std::string act(const std::string& action,
                  const std::map<std::string, std::string>& values) override {
    pressed = action;
    for (const auto& [name, value] : values) pressed += " " + name + "=" + value;
    return action == "refused" ? "not now" : "";
  }
  std::string pressed;
};

class LabPage : public ::testing::Test {
 protected:
  LabPage() : server_(0), client_("127.0.0.1", server_.port()) {
    server_.set_desk(desk_);
    thread_ = std::thread([this] { server_.run(); });
    const std::string link = server_.link();
    const auto host = link.find(std::to_string(server_.port()));
    root_ = link.substr(link.find('/', host));
    for (int i = 0; i < 100 && !client_.Get("/"); ++i) {
    }
  }
  ~LabPage() override {
    server_.stop();
    thread_.join();
  }
  NotingDesk desk_;
  LabServer server_;
  httplib::Client client_;
  std::thread thread_;
  std::string root_;
};

TEST_F(LabPage, ShowsThePageItsStatusAndPictures) {
  const auto page = client_.Get(root_.c_str());
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_THAT(page->body, HasSubstr("<title>Laboratory"));
  EXPECT_THAT(page->body, HasSubstr("rel=\"icon\" href=\"data:,\""));  // asks for no /favicon.ico
  EXPECT_THAT(page->get_header_value("Content-Security-Policy"), HasSubstr("default-src 'none'"));
  EXPECT_EQ(client_.Get((root_ + "status").c_str())->body,
            "{\"poses\":3,\"folder\":\"\xef\xbf\xbd\"}");  // U+FFFD for what is not UTF-8
  EXPECT_EQ(client_.Get((root_ + "preview/1").c_str())->body, "JPEG");
  EXPECT_EQ(client_.Get((root_ + "preview/0").c_str())->status, 404);
  EXPECT_EQ(client_.Get((root_ + "preview/99999999999999999999").c_str())->status, 404);
}

TEST_F(LabPage, ButtonsActWithTheirValues) {
  EXPECT_EQ(client_.Post((root_ + "act/show?what=white&projector=proj%200").c_str())->status, 200);
  EXPECT_EQ(desk_.pressed, "show projector=proj 0 what=white");
  const auto refused = client_.Post((root_ + "act/refused").c_str());
  EXPECT_EQ(refused->status, 409);
  EXPECT_EQ(refused->body, "not now\n");
}

TEST_F(LabPage, NobodyElsePressesButtons) {
  EXPECT_EQ(client_.Post("/act/capture")->status, 403);
  EXPECT_EQ(client_.Post(("/" + std::string(32, '0') + "/act/capture").c_str())->status, 403);
  const httplib::Headers foreign{{"Host", "evil.example"}};
  EXPECT_EQ(client_.Post((root_ + "act/capture").c_str(), foreign, "", "text/plain")->status, 403);
  EXPECT_NE(client_.Get((root_ + "act/capture").c_str())->status, 200);  // no link, no picture
  EXPECT_EQ(desk_.pressed, "");
}

TEST_F(LabPage, IdleConnectionsDoNotDelayIt) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(server_.port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto idle = [&](int count) {
    std::vector<int> sockets;
    for (int i = 0; i < count; ++i) {
      sockets.push_back(::socket(AF_INET, SOCK_STREAM, 0));
      EXPECT_EQ(
          ::connect(sockets.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address),
          0);
    }
    return sockets;
  };
  client_.set_read_timeout(60);
  // With a thread for each of four and 5 s for a first byte, twelve would take 15 s, and the others
  // more than a minute. The bounds leave a busy machine its time.
  for (const auto& [count, seconds] : {std::pair(12, 5), std::pair(60, 12)}) {
    const std::vector<int> silent = idle(count);
    const auto begin = std::chrono::steady_clock::now();
    const auto answer = client_.Get((root_ + "status").c_str());
    const auto taken = std::chrono::steady_clock::now() - begin;
    ASSERT_TRUE(answer) << count;
    EXPECT_EQ(answer->status, 200);
    EXPECT_LT(taken, std::chrono::seconds(seconds)) << count;
    for (const int connection : silent) ::close(connection);
  }
}

}  // namespace
}  // namespace pencilscan
