#include "pencilscan/server/gate.h"

#include <arpa/inet.h>
#include <sys/random.h>
#include <sys/socket.h>

#include <array>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

constexpr const char* kLoopback = "127.0.0.1";
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src 'self' data: blob:; media-src blob:; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

/// Only an exclusive port: the library's default would share it with other programs.
void exclusive_port(int socket) {
  const int yes = 1;
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes));
}

/// 128 random bits: nobody guesses them.
std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw StageError("the system gives no random numbers");
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : bytes) {
    text.push_back(kDigits[byte >> 4]);
    text.push_back(kDigits[byte & 15]);
  }
  return text;
}

/// Takes as long for any two texts of equal length, wherever they differ.
bool equal_in_constant_time(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return difference == 0;
}

}  // namespace

Gate::Gate(const std::string& address) : address_(address), token_(random_token()) {
  // One address, not all: requests have to name it.
  in_addr parsed{};
  if (::inet_pton(AF_INET, address.c_str(), &parsed) != 1 || parsed.s_addr == INADDR_ANY)
    throw InputError("--listen", "", address,
                     "must be one IPv4 address of this computer, as 192.168.0.7");
}

bool Gate::names_this_host(const httplib::Request& request) const {
  const std::string host = request.get_header_value("Host");
  const std::string end = ":" + std::to_string(port_);
  return host == address_ + end || (address_ == kLoopback && host == "localhost" + end);
}

bool Gate::knows_token(const httplib::Request& request) const {
  const std::string_view path = request.path;
  const std::size_t length = token_.size() + 2;
  return path.size() >= length &&
         equal_in_constant_time(path.substr(0, length), "/" + token_ + "/");
}

void Gate::guard(httplib::Server& server, int port, const std::string& only_by) {
  server.set_socket_options(exclusive_port);
  server.set_payload_max_length(0);
  if (port == 0) {
    port_ = server.bind_to_any_port(address_);
  } else {
    port_ = server.bind_to_port(address_, port) ? port : -1;
  }
  if (port_ <= 0)
    throw StageError("port " + std::to_string(port) + " on " + address_ +
                     " is not free, or that is no address of this computer");
  server.set_default_headers({{"Content-Security-Policy", kPolicy},
                              {"X-Content-Type-Options", "nosniff"},
                              {"X-Frame-Options", "DENY"},
                              {"Referrer-Policy", "no-referrer"},
                              {"Cross-Origin-Resource-Policy", "same-origin"},
                              {"Accept-Ranges", "none"},
                              {"Cache-Control", "no-cache"}});
  server.set_pre_routing_handler(
      [this, only_by](const httplib::Request& request, httplib::Response& response) {
        if (names_this_host(request) && knows_token(request))
          return httplib::Server::HandlerResponse::Unhandled;
        refuse(response, 403, only_by);
        return httplib::Server::HandlerResponse::Handled;
      });
}

std::string Gate::link() const {
  return "http://" + address_ + ":" + std::to_string(port_) + path();
}

void refuse(httplib::Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(why + "\n", "text/plain");
}

}  // namespace pencilscan
