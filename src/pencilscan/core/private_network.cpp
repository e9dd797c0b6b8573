#include "pencilscan/core/private_network.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw StageError("no network of its own can be made: " + what + ": " + std::strerror(errno) +
                   " (does the kernel let users have namespaces? sysctl "
                   "kernel.unprivileged_userns_clone; containers often do not)");
}

void write_to(const char* path, const std::string& text) {
  const int file = ::open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0) fail(path);
  const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(file);
  if (!written) fail(path);
}

ifreq request_for(const std::string& name) {
  ifreq request{};
  name.copy(request.ifr_name, IFNAMSIZ - 1);
  return request;
}

void set_address(int socket, unsigned long what, const std::string& name, const std::string& ip) {
  ifreq request = request_for(name);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, ip.c_str(), &address.sin_addr);
  std::memcpy(&request.ifr_addr, &address, sizeof address);
  if (::ioctl(socket, what, &request) != 0) fail("address " + ip);
}

}  // namespace

void enter_private_network(int addresses) {
  const auto user = ::getuid();
  const auto group = ::getgid();
  if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) fail("unshare");
  // Everybody stays who he is.
  write_to("/proc/self/setgroups", "deny");
  write_to("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1");
  write_to("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) fail("socket");
  ifreq loopback = request_for("lo");
  if (::ioctl(socket, SIOCGIFFLAGS, &loopback) != 0) fail("lo");
  loopback.ifr_flags = static_cast<short>(loopback.ifr_flags | IFF_UP);
  if (::ioctl(socket, SIOCSIFFLAGS, &loopback) != 0) fail("lo");
  for (int i = 2; i <= addresses; ++i) {
    const std::string name = "lo:" + std::to_string(i);
    set_address(socket, SIOCSIFADDR, name, "127.0.0." + std::to_string(i));
    set_address(socket, SIOCSIFNETMASK, name, "255.0.0.0");
  }
  ::close(socket);
}

}  // namespace pencilscan
