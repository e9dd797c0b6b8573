// Requests to the server of `view`: the input is a request in which @ stands for the token, $ for
// the server's own name and number, and lines may end with a bare newline. Whatever is asked, the
// secret beside the folder is not answered, and without the token nothing is.

#include <algorithm>
#include <cstdlib>

#include "fuzz.h"
#include "pencilscan/page/sample_result.h"
#include "pencilscan/server/view_server.h"

namespace pencilscan::fuzz {
namespace {

constexpr std::string_view kSecret = "nobody-may-read-this";

struct Site {
  Site() {
    sample::write_output(scratch() / "out", 1);
    put("secret.txt", kSecret);
    std::filesystem::create_symlink(scratch() / "secret.txt", scratch() / "out" / "link.txt");
    server = std::make_unique<ViewServer>(scratch() / "out", ViewOptions{});
    const std::string link = server->link();
    token = link.substr(link.size() - 33, 32);
    host = "127.0.0.1:" + std::to_string(server->port());
  }
  std::unique_ptr<ViewServer> server;
  std::string token;
  std::string host;
};

std::string request_of(std::string_view input, const Site& site) {
  std::string request;
  for (const char c : input) {
    if (c == '@') {
      request += site.token;
    } else if (c == '$') {
      request += site.host;
    } else {
      if (c == '\n' && !request.ends_with('\r')) request.push_back('\r');
      request.push_back(c);
    }
  }
  return request + "\r\n\r\n";
}

}  // namespace
}  // namespace pencilscan::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pencilscan::fuzz;
  static Site site;
  const std::string request = request_of(text_of(data, size), site);
  const std::string answer = site.server->answer(request);
  if (answer.find(kSecret) != std::string::npos) std::abort();
  const bool knows = request.find(site.token) != std::string::npos;
  if (!knows && answer.find(" 200 ") == 8) std::abort();  // "HTTP/1.1 200 OK"
  return 0;
}
