#include "pencilscan/server/limited_server.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>

namespace pencilscan {
namespace {

using ServerClock = std::chrono::steady_clock;

/// Waits for a socket; false when the time is over.
bool is_ready(int socket, short events, ServerClock::time_point until) {
  const double seconds = std::chrono::duration<double>(until - ServerClock::now()).count();
  pollfd waiting{};
  waiting.fd = socket;
  waiting.events = events;
  return seconds > 0 && ::poll(&waiting, 1, static_cast<int>(std::ceil(1000 * seconds))) > 0;
}

ServerClock::time_point in_seconds(double seconds) {
  return ServerClock::now() +
         std::chrono::duration_cast<ServerClock::duration>(std::chrono::duration<double>(seconds));
}

/// The bytes up to the empty line that ends the headers; nothing when they are too many or too
/// late.
std::optional<std::string> read_request(int socket) {
  const auto until = in_seconds(LimitedServer::kRequestSeconds);
  if (!is_ready(socket, POLLIN, in_seconds(LimitedServer::kFirstByteSeconds))) return std::nullopt;
  std::string request;
  char block[4096];
  while (request.find("\r\n\r\n") == std::string::npos) {
    if (request.size() >= LimitedServer::kLongestRequest || !is_ready(socket, POLLIN, until))
      return std::nullopt;
    const ssize_t got = ::recv(socket, block, sizeof block, 0);
    if (got <= 0) return std::nullopt;
    request.append(block, static_cast<std::size_t>(got));
  }
  return request;
}

/// True for a line "Range: bytes=0-9".
bool asks_for_range(std::string_view line) {
  constexpr std::string_view kName = "range:";
  std::string name(line.substr(0, kName.size()));
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name == kName;
}

/// Without the headers that ask for a part: the library would refuse those that it cannot read.
std::string without_ranges(const std::string& request) {
  std::string kept;
  for (std::size_t begin = 0; begin < request.size();) {
    const std::size_t end = std::min(request.find('\n', begin), request.size() - 1) + 1;
    const std::string_view line = std::string_view(request).substr(begin, end - begin);
    if (!asks_for_range(line)) kept += line;
    begin = end;
  }
  return kept;
}

/// A request that is whole already; what writes may do is the socket's or the test's.
class RequestStream : public httplib::Stream {
 public:
  explicit RequestStream(const std::string& request) : request_(without_ranges(request)) {}

  bool is_readable() const override { return at_ < request_.size(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* into, std::size_t size) override {
    const std::size_t count = std::min(size, request_.size() - at_);
    std::memcpy(into, request_.data() + at_, count);
    at_ += count;
    return static_cast<ssize_t>(count);
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip = "";
    port = 0;
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    ip = "";
    port = 0;
  }
  socket_t socket() const override { return INVALID_SOCKET; }

 private:
  std::string request_;
  std::size_t at_ = 0;
};

class SocketStream : public RequestStream {
 public:
  SocketStream(const std::string& request, int socket) : RequestStream(request), socket_(socket) {}

  ssize_t write(const char* bytes, std::size_t size) override {
    if (!is_ready(socket_, POLLOUT, in_seconds(LimitedServer::kStallSeconds))) return -1;
    return ::send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  socket_t socket() const override { return socket_; }

 private:
  int socket_;
};

class TextStream : public RequestStream {
 public:
  using RequestStream::RequestStream;
  ssize_t write(const char* bytes, std::size_t size) override {
    text.append(bytes, size);
    return static_cast<ssize_t>(size);
  }
  std::string text;
};

}  // namespace

LimitedServer::LimitedServer(int answers_at_once) : answers_(answers_at_once) {
  new_task_queue = [] {
    return new httplib::ThreadPool(kConnections);  // NOLINT: the server takes it
  };
}

bool LimitedServer::serve(httplib::Stream& stream) {
  bool closed = false;
  return process_request(stream, true, closed, nullptr);
}

std::string LimitedServer::answer(const std::string& request) {
  if (request.size() > kLongestRequest || request.find("\r\n\r\n") == std::string::npos) return "";
  TextStream stream(request);
  serve(stream);
  return stream.text;
}

bool LimitedServer::process_and_close_socket(socket_t socket) {
  bool done = false;
  if (const auto request = read_request(socket)) {
    SocketStream stream(*request, socket);
    answers_.acquire();
    done = serve(stream);
    answers_.release();
  }
  ::shutdown(socket, SHUT_RDWR);
  ::close(socket);
  return done;
}

}  // namespace pencilscan
