#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "pencilscan/core/error.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/page/sample_result.h"
#include "pencilscan/server/http.h"
#include "pencilscan/server/served_files.h"
#include "pencilscan/server/view_server.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
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
    server_->stop();
    thread_.join();
  }
  /// "/<token>", before the paths of the page.
  std::string token() const {
    const std::string link = server_->link();
    const auto end = link.size() - 1;
    return link.substr(link.rfind('/', end - 1), end - link.rfind('/', end - 1));
  }
  int status(const std::string& path, const httplib::Headers& headers = {}) {
    const auto answer = client_->Get((token() + path).c_str(), headers);
    return answer ? answer->status : -1;
  }
  std::string body(const std::string& path) {
    const auto answer = client_->Get((token() + path).c_str());
    return answer ? answer->body : "";
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path base_ = temporary_.path();
  fs::path root_;
  std::unique_ptr<ViewServer> server_;
  std::thread thread_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(Served, AStopThatComesBeforeItRunsIsKept) {
  ViewServer other(root_, ViewOptions{});
  other.stop();
  other.run();  // does not wait for a second one
}

TEST_F(Served, GivesThePageItsPartsAndTheFiles) {
  EXPECT_THAT(body("/"), HasSubstr("\"mode\":\"view\""));
  for (const char* part : {"details", "mesh", "points", "curves", "image/0", "depth/1", "play/5"})
    EXPECT_EQ(status(std::string("/part/0/") + part), 200) << part;
  EXPECT_LT(body("/part/0/play/1").size(), body("/part/0/play/400").size());
  write_json(root_ / "sequence.json", {{"format", "sequence/1"}});
  EXPECT_EQ(status("/part/sequence/0"), 200);
  EXPECT_EQ(body("/files/000000/points.ply"), read_file(root_ / "000000" / "points.ply"));
  EXPECT_THAT(body("/list/0"), HasSubstr("000000/mesh.ply"));
}

TEST_F(Served, ListsFilesWithNamesInLatin1) {
  write_text(root_ / "000000" / "caf\xe9.txt", "x");
  EXPECT_THAT(body("/list/0"),
              AllOf(HasSubstr("000000/mesh.ply"), HasSubstr("caf\xef\xbf\xbd.txt")));
}

TEST_F(Served, SaysWhatItDoesNotHave) {
  for (const char* path :
       {"/part/1/mesh", "/part/99999999999999999999/mesh", "/part/0/image/7", "/part/sequence/0",
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
    const auto answer = client_->Get((token() + path).c_str());
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
  const std::string file = token() + "/files/000000/points.ply";
  EXPECT_NE(client_->Post(file.c_str(), "x", "text/plain")->status, 200);
  EXPECT_NE(client_->Delete(file.c_str())->status, 200);
  EXPECT_TRUE(fs::exists(root_ / "000000" / "points.ply"));
}

TEST_F(Served, ForbidsEveryPathWithoutTheToken) {
  const std::string other(token().size() - 1, '0');
  for (const std::string& path :
       {std::string("/"), std::string("/files/000000/points.ply"), std::string("/part/0/mesh"),
        "/" + other + "/", token().substr(0, 20) + "/", token(), token() + "0/",
        "/" + other + token() + "/", "/files/.." + token() + "/"}) {
    const auto answer = client_->Get(path.c_str());
    ASSERT_TRUE(answer) << path;
    EXPECT_EQ(answer->status, 403) << path;
    EXPECT_LT(answer->body.size(), 100U) << path;
  }
}

TEST_F(Served, EveryServerHasATokenOfItsOwn) {
  const ViewServer other(root_, ViewOptions{});
  EXPECT_EQ(token().size(), 33U);
  EXPECT_EQ(other.link().find(token()), std::string::npos);
}

TEST_F(Served, ForbidsFramesForeignScriptsAndReferrers) {
  for (const std::string& path : {token() + "/", token() + "/none", std::string("/")}) {
    const auto answer = client_->Get(path.c_str());
    ASSERT_TRUE(answer) << path;
    EXPECT_EQ(answer->get_header_value("X-Frame-Options"), "DENY");
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
    EXPECT_EQ(answer->get_header_value("Referrer-Policy"), "no-referrer");
    EXPECT_THAT(answer->get_header_value("Content-Security-Policy"),
                AllOf(HasSubstr("default-src 'none'"), HasSubstr("frame-ancestors 'none'")));
  }
}

/// Sends bytes over a connection of its own, `pause` seconds after each block, and gives what comes
/// back until the server closes it.
std::string exchange(int port, const std::vector<std::string>& blocks, double pause = 0) {
  const int connection = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return "no connection";
  for (const std::string& block : blocks) {
    if (::send(connection, block.data(), block.size(), MSG_NOSIGNAL) < 0) break;
    std::this_thread::sleep_for(std::chrono::duration<double>(pause));
  }
  std::string answer;
  char bytes[4096];
  for (ssize_t got = 0; (got = ::recv(connection, bytes, sizeof bytes, 0)) > 0;)
    answer.append(bytes, static_cast<std::size_t>(got));
  ::close(connection);
  return answer;
}

TEST_F(Served, ClosesConnectionsThatAskTooMuchOrTooSlowly) {
  const int port = server_->port();
  const std::string host = "Host: 127.0.0.1:" + std::to_string(port) + "\r\n";
  const std::string line = "GET " + token() + "/list/0 HTTP/1.1\r\n";
  EXPECT_THAT(exchange(port, {line + host, "\r\n"}), HasSubstr("200 OK"));
  EXPECT_EQ(exchange(port, {line, host + "X: " + std::string(20'000, 'x') + "\r\n\r\n"}), "");
  EXPECT_EQ(exchange(port, {std::string(100'000, 'x')}), "");
  // A byte a second would keep a thread for ever under limits on single bytes.
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(exchange(port, std::vector<std::string>(9, "G"), 1), "");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(60));
  EXPECT_EQ(status("/list/0"), 200);
}

TEST_F(Served, OpenConnectionsThatSayNothingDoNotKeepOthersOut) {
  std::vector<int> silent;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(server_->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (int i = 0; i < 16; ++i) {
    silent.push_back(::socket(AF_INET, SOCK_STREAM, 0));
    EXPECT_EQ(::connect(silent.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address),
              0);
  }
  client_->set_read_timeout(60);
  EXPECT_EQ(status("/list/0"), 200);
  for (const int connection : silent) ::close(connection);
}

TEST_F(Served, WhoAsksForAPartGetsTheWhole) {
  const std::string file = token() + "/files/000000/points.ply";
  const auto size = fs::file_size(root_ / "000000" / "points.ply");
  for (const char* range : {"bytes=0-9", "bytes=9-0", "lines=1-2", "nonsense", ""}) {
    for (const char* name : {"Range", "range"}) {
      const auto answer = client_->Get(file.c_str(), {{name, range}});
      ASSERT_TRUE(answer) << range;
      EXPECT_EQ(answer->status, 200) << range;
      EXPECT_EQ(answer->body.size(), size) << range;
    }
  }
  const auto head = client_->Head(file.c_str());
  ASSERT_TRUE(head);
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->get_header_value("Accept-Ranges"), "none");
}

TEST_F(Served, TheLongestRequestsFitTheStack) {
  const std::string host = "Host: 127.0.0.1:" + std::to_string(server_->port()) + "\r\n";
  const std::string path = token() + "/files/" + std::string(8000, 'a');
  EXPECT_THAT(server_->answer("GET " + path + " HTTP/1.1\r\n" + host + "\r\n"),
              HasSubstr("404 Not Found"));
  std::string ranges = "Range: bytes=";
  while (ranges.size() < 8000) ranges += "0-,";
  const std::string many = server_->answer(
      "GET " + token() + "/files/000000/points.ply HTTP/1.1\r\n" + host + ranges + "0-\r\n\r\n");
  EXPECT_LT(many.size(), 2 * fs::file_size(root_ / "000000" / "points.ply") + 2000);
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

TEST_F(Served, AFolderWithoutResultsIsRefused) {
  fs::create_directories(base_ / "empty");
  EXPECT_THROW(ViewServer(base_ / "empty", ViewOptions{}), InputError);
}

TEST_F(Served, OnlyAnAddressOfThisComputerIsListenedOn) {
  for (const char* address : {"0.0.0.0", "localhost", "::", "", "192.0.2.1.5"}) {
    ViewOptions options;
    options.address = address;
    EXPECT_THROW(ViewServer(root_, options), InputError) << address;
  }
  ViewOptions another;
  another.address = "127.0.0.2";
  ViewServer server(root_, another);
  EXPECT_THAT(server.link(), HasSubstr("http://127.0.0.2:"));
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
