#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <unistd.h>

#include <thread>

// clang-format off
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/core/error.h"
#include "pencilscan/page/sample_result.h"
#include "pencilscan/server/served_files.h"
#include "pencilscan/server/view_server.h"

// After all that includes Eigen: its <resolv.h> defines a macro that Eigen uses as a name.
#include <httplib.h>
// clang-format on

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// A folder with one frame, a secret beside it, and a server on a free port.
class Served : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = base_ / "out";
    sample::write_output(root_, 1);
    write_text(base_ / "secret.txt", "secret");
    server_ = std::make_unique<ViewServer>(root_, ViewOptions{});
    thread_ = std::thread([this] { server_->run(); });
    client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
  }
  void TearDown() override {
    client_.reset();
    // listen_after_bind() may not have begun yet: ask until it answers once.
    for (int i = 0; i < 100; ++i) {
      httplib::Client client("127.0.0.1", server_->port());
      if (client.Get("/list/0")) break;
    }
    server_->stop();
    thread_.join();
  }
  int status(const std::string& path, const httplib::Headers& headers = {}) {
    const auto answer = client_->Get(path.c_str(), headers);
    return answer ? answer->status : -1;
  }
  std::string body(const std::string& path) {
    const auto answer = client_->Get(path.c_str());
    return answer ? answer->body : "";
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path base_ = temporary_.path();
  fs::path root_;
  std::unique_ptr<ViewServer> server_;
  std::thread thread_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(Served, GivesThePageItsPartsAndTheFiles) {
  EXPECT_THAT(body("/"), HasSubstr("\"mode\":\"view\""));
  for (const char* part : {"details", "mesh", "points", "curves", "image/0", "depth/1", "play"})
    EXPECT_EQ(status(std::string("/part/0/") + part), 200) << part;
  EXPECT_EQ(body("/files/000000/points.ply"), read_file(root_ / "000000" / "points.ply"));
  EXPECT_THAT(body("/list/0"), HasSubstr("000000/mesh.ply"));
}

TEST_F(Served, SaysWhatItDoesNotHave) {
  for (const char* path : {"/part/1/mesh", "/part/99999999999999999999/mesh", "/part/0/image/7",
                           "/part/0/nothing", "/files/none.ply", "/elsewhere"}) {
    EXPECT_EQ(status(path), 404) << path;
  }
}

TEST_F(Served, NoPathLeavesTheFolder) {
  fs::create_symlink(base_ / "secret.txt", root_ / "link.txt");
  fs::create_directory_symlink(base_, root_ / "up");
  for (const char* path :
       {"/files/../secret.txt", "/files/%2e%2e/secret.txt", "/files/..%2fsecret.txt",
        "/files/000000/../../secret.txt", "/files/%2fetc%2fpasswd", "/files//etc/passwd",
        "/files/....//secret.txt", "/files/link.txt", "/files/up/secret.txt", "/files/%00",
        "/../secret.txt", "/files/000000", "/files/."}) {
    const auto answer = client_->Get(path);
    ASSERT_TRUE(answer) << path;
    EXPECT_NE(answer->status, 200) << path;
    EXPECT_EQ(answer->body.find("secret"), std::string::npos) << path;
  }
}

TEST_F(Served, AnswersOnlyThoseWhoAskForThisHost) {
  EXPECT_EQ(status("/", {{"Host", "evil.example"}}), 403);
  EXPECT_EQ(status("/files/000000/points.ply", {{"Host", "192.168.0.1"}}), 403);
  EXPECT_EQ(status("/", {{"Host", "localhost:" + std::to_string(server_->port())}}), 200);
}

TEST_F(Served, ChangesNothing) {
  EXPECT_NE(client_->Post("/files/000000/points.ply", "x", "text/plain")->status, 200);
  EXPECT_NE(client_->Delete("/files/000000/points.ply")->status, 200);
  EXPECT_TRUE(fs::exists(root_ / "000000" / "points.ply"));
}

TEST_F(Served, IsNotReachableOnOtherInterfaces) {
  ifaddrs* all = nullptr;
  ASSERT_EQ(getifaddrs(&all), 0);
  for (const ifaddrs* it = all; it != nullptr; it = it->ifa_next) {
    if (it->ifa_addr == nullptr || it->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(it->ifa_addr)->sin_addr, text,
              sizeof text);
    if (std::string(text).starts_with("127.")) continue;
    httplib::Client outside(text, server_->port());
    outside.set_connection_timeout(1);
    EXPECT_FALSE(outside.Get("/")) << text;
  }
  freeifaddrs(all);
}

TEST_F(Served, APortInUseIsAFailureAndNotShared) {
  ViewOptions same;
  same.port = server_->port();
  EXPECT_THROW(ViewServer(root_, same), StageError);
}

TEST(ServedFiles, AreInsideTheRootOnly) {
  const fs::path base =
      fs::temp_directory_path() / ("pencilscan_inside_" + std::to_string(::getpid()));
  write_text(base / "out" / "a" / "b.txt", "b");
  write_text(base / "outside.txt", "o");
  write_text(base / "out2" / "c.txt", "c");
  EXPECT_TRUE(file_inside(base / "out", "a/b.txt"));
  EXPECT_FALSE(file_inside(base / "out", "../out2/c.txt"));
  EXPECT_FALSE(file_inside(base / "out", "a/../a/b.txt"));
  EXPECT_FALSE(file_inside(base / "out", (base / "outside.txt").string()));
  EXPECT_FALSE(file_inside(base / "out", ""));
  EXPECT_FALSE(file_inside(base / "out", std::string("a/b.txt\0x", 9)));
  fs::remove_all(base);
}

}  // namespace
}  // namespace pencilscan
