#include "pencilscan/server/view_server.h"

#include <arpa/inet.h>
#include <sys/random.h>
#include <sys/socket.h>

#include <array>
#include <fstream>
#include <list>
#include <map>
#include <mutex>
#include <string>

#include "pencilscan/core/error.h"
#include "pencilscan/server/limited_server.h"
#include "pencilscan/server/served_files.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLoopback = "127.0.0.1";
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src 'self' data: blob:; media-src blob:; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";
constexpr int kRequestThreads = 8;
constexpr std::size_t kOpenReaders = 4;
constexpr std::size_t kPlayFaces = 20'000;  ///< of a mesh while a sequence plays

/// One address, not all: requests have to name it.
void check_address(const std::string& address) {
  in_addr parsed{};
  if (::inet_pton(AF_INET, address.c_str(), &parsed) != 1 || parsed.s_addr == INADDR_ANY)
    throw InputError("--listen", "", address,
                     "must be one IPv4 address of this computer, as 192.168.0.7");
}

Detail full_detail(std::size_t results) {
  Detail detail;
  detail.max_faces = 400'000;
  detail.image_width = 4096;
  detail.image_quality = 92;
  detail.evaluate = results <= 8;
  return detail;
}

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

/// The few readers used last, so that the parts of one result do not read its files again.
class Readers {
 public:
  explicit Readers(const PageData& data) : data_(data) {}

  std::shared_ptr<ResultReader> get(std::size_t result, bool playing) {
    const std::lock_guard lock(mutex_);
    const std::size_t key = 2 * result + (playing ? 1 : 0);
    for (auto it = open_.begin(); it != open_.end(); ++it) {
      if (it->first != key) continue;
      open_.splice(open_.begin(), open_, it);
      return open_.front().second;
    }
    Detail detail = full_detail(data_.size());
    if (playing) {
      detail.shape_only = true;
      detail.max_faces = kPlayFaces;
    }
    open_.emplace_front(key, data_.open(result, detail));
    if (open_.size() > kOpenReaders) open_.pop_back();
    return open_.front().second;
  }

 private:
  const PageData& data_;
  std::mutex mutex_;
  std::list<std::pair<std::size_t, std::shared_ptr<ResultReader>>> open_;
};

std::string part_type(const std::string& name) {
  if (name == "thumb") return "image/jpeg";
  if (name.starts_with("image/")) return "image/webp";
  return name.starts_with("holes/") ? "image/png" : "application/octet-stream";
}

void fail(httplib::Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(why + "\n", "text/plain");
}

}  // namespace

struct ViewServer::State {
  State(const fs::path& folder, const PageOptions& options)
      : root(folder), data(folder, options), readers(data), experiment(data.experiment({})) {}

  void add_routes();
  void answer_part(const httplib::Request& request, httplib::Response& response);
  void answer_list(const httplib::Request& request, httplib::Response& response);
  void answer_picture(const httplib::Request& request, httplib::Response& response);
  void answer_file(const httplib::Request& request, httplib::Response& response);
  std::string make_page() const;
  bool names_this_host(const httplib::Request& request) const;
  bool knows_token(const httplib::Request& request) const;
  /// The number in the first group of a route; nothing when there is no such result.
  std::optional<std::size_t> result_of(const httplib::Request& request) const;

  fs::path root;
  PageData data;
  Readers readers;
  std::optional<ExperimentPage> experiment;
  LimitedServer server;
  std::string address;
  int port = 0;
  std::string token = random_token();
  std::string page;
};

std::string ViewServer::State::make_page() const {
  std::vector<nlohmann::ordered_json> entries;
  for (std::size_t i = 0; i < data.size(); ++i) {
    const auto reader = data.open(i, full_detail(data.size()));
    entries.push_back(data.entry(i, *reader, reader->part_names()));
  }
  return served_page(data.index("view", std::move(entries),
                                experiment ? experiment->json : nlohmann::ordered_json()));
}

bool ViewServer::State::names_this_host(const httplib::Request& request) const {
  const std::string host = request.get_header_value("Host");
  const std::string end = ":" + std::to_string(port);
  return host == address + end || (address == kLoopback && host == "localhost" + end);
}

bool ViewServer::State::knows_token(const httplib::Request& request) const {
  const std::string_view path = request.path;
  const std::size_t length = token.size() + 2;
  return path.size() >= length && equal_in_constant_time(path.substr(0, length), "/" + token + "/");
}

std::optional<std::size_t> ViewServer::State::result_of(const httplib::Request& request) const {
  const std::string digits = request.matches[1];
  if (digits.size() > 9) return std::nullopt;
  const auto result = static_cast<std::size_t>(std::stoul(digits));
  return result < data.size() ? std::optional(result) : std::nullopt;
}

void ViewServer::State::answer_part(const httplib::Request& request, httplib::Response& response) {
  const auto result = result_of(request);
  if (!result) return fail(response, 404, "no such result");
  const std::string name = request.matches[2];
  const bool playing = name == "play" || (name == "thumb" && data.size() > 1);
  const auto reader = readers.get(*result, playing);
  auto bytes = reader->part(name == "play" ? "mesh" : name);
  if (!bytes) {
    std::string why = "not in this result: " + name;
    for (const auto& missing : reader->missing()) {
      if (missing.what == name || missing.what.starts_with(name + ".")) why = missing.why;
    }
    return fail(response, 404, why);
  }
  response.set_content(std::move(*bytes), part_type(name));
}

void ViewServer::State::answer_list(const httplib::Request& request, httplib::Response& response) {
  const auto result = result_of(request);
  if (!result) return fail(response, 404, "no such result");
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ServedFile& file : files_below(root, data.folder().results[*result].folder))
    list.push_back({{"path", file.path}, {"bytes", file.bytes}});
  response.set_content(list.dump(), "application/json");
}

/// As bytes only: a drawing that is opened by its address must not run as a page of this server.
void ViewServer::State::answer_picture(const httplib::Request& request,
                                       httplib::Response& response) {
  const std::string digits = request.matches[1];
  const std::size_t count = experiment ? experiment->pictures.size() : 0;
  const std::size_t index = digits.size() > 9 ? count : std::stoul(digits);
  if (index >= count) return fail(response, 404, "no such picture");
  response.set_content(experiment->pictures[index], "application/octet-stream");
}

void ViewServer::State::answer_file(const httplib::Request& request, httplib::Response& response) {
  const auto file = file_inside(root, request.matches[1]);
  if (!file) return fail(response, 404, "no such file in this folder");
  auto stream = std::make_shared<std::ifstream>(*file, std::ios::binary);
  std::error_code error;
  const auto size = fs::file_size(*file, error);
  if (!*stream || error) return fail(response, 404, "the file cannot be read");
  if (size == 0) return response.set_content("", content_type(*file).c_str());
  response.set_content_provider(
      static_cast<std::size_t>(size), content_type(*file).c_str(),
      [stream](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        std::string bytes(std::min<std::size_t>(length, std::size_t{1} << 18), '\0');
        stream->seekg(static_cast<std::streamoff>(offset));
        stream->read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
        const auto got = static_cast<std::size_t>(stream->gcount());
        return got > 0 && sink.write(bytes.data(), got);
      });
}

void ViewServer::State::add_routes() {
  server.set_default_headers({{"Content-Security-Policy", kPolicy},
                              {"X-Content-Type-Options", "nosniff"},
                              {"X-Frame-Options", "DENY"},
                              {"Referrer-Policy", "no-referrer"},
                              {"Cross-Origin-Resource-Policy", "same-origin"},
                              {"Cache-Control", "no-cache"}});
  server.set_pre_routing_handler(
      [this](const httplib::Request& request, httplib::Response& response) {
        if (names_this_host(request) && knows_token(request))
          return httplib::Server::HandlerResponse::Unhandled;
        fail(response, 403, "only by the link that pencilscan view prints");
        return httplib::Server::HandlerResponse::Handled;
      });
  const std::string root_path = "/" + token + "/";
  server.Get(root_path, [this](const httplib::Request&, httplib::Response& response) {
    response.set_content(page, "text/html; charset=utf-8");
  });
  server.Get(root_path + R"(part/(\d+)/([a-z]+(?:/\d+)?))",
             [this](const auto& request, auto& response) { answer_part(request, response); });
  server.Get(root_path + R"(part/experiment/(\d+))",
             [this](const auto& request, auto& response) { answer_picture(request, response); });
  server.Get(root_path + R"(list/(\d+))",
             [this](const auto& request, auto& response) { answer_list(request, response); });
  server.Get(root_path + R"(files/(.+))",
             [this](const auto& request, auto& response) { answer_file(request, response); });
}

ViewServer::ViewServer(const fs::path& root, const ViewOptions& options)
    : state_(std::make_unique<State>(root, options.page)) {
  State& state = *state_;
  check_address(options.address);
  state.address = options.address;
  state.server.set_socket_options(exclusive_port);
  state.server.set_payload_max_length(0);
  state.server.new_task_queue = [] {
    return new httplib::ThreadPool(kRequestThreads);  // NOLINT: the server takes it
  };
  if (options.port == 0) {
    state.port = state.server.bind_to_any_port(state.address);
  } else {
    state.port = state.server.bind_to_port(state.address, options.port) ? options.port : -1;
  }
  if (state.port <= 0)
    throw StageError("port " + std::to_string(options.port) + " on " + state.address +
                     " is not free, or that is no address of this computer");
  state.page = state.make_page();
  state.add_routes();
}

ViewServer::~ViewServer() = default;

int ViewServer::port() const { return state_->port; }
std::string ViewServer::link() const {
  return "http://" + state_->address + ":" + std::to_string(state_->port) + "/" + state_->token +
         "/";
}
std::string ViewServer::answer(const std::string& request) {
  return state_->server.answer(request);
}
std::size_t ViewServer::results() const { return state_->data.size(); }
void ViewServer::run() { state_->server.listen_after_bind(); }
void ViewServer::stop() { state_->server.stop(); }

}  // namespace pencilscan
