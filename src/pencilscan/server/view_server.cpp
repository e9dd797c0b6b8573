#include "pencilscan/server/view_server.h"

#include <algorithm>
#include <fstream>
#include <list>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/page/sequence_part.h"
#include "pencilscan/server/guarded_server.h"
#include "pencilscan/server/served_files.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr int kViewAnswersAtOnce = 8;
constexpr std::size_t kOpenReaders = 4;
constexpr std::size_t kThumbFaces = 20'000;  ///< of a mesh that is drawn as a small picture
constexpr std::size_t kMostPlayFaces = 400'000;

Detail full_detail(std::size_t results) {
  Detail detail;
  detail.max_faces = 400'000;
  detail.image_width = 4096;
  detail.image_quality = 92;
  detail.evaluate = results <= 8;
  return detail;
}

/// The few readers used last, so that the parts of one result do not read its files again.
class Readers {
 public:
  explicit Readers(const PageData& data) : data_(data) {}

  /// play_faces: of the shape alone, as it plays; 0: of the whole result.
  std::shared_ptr<ResultReader> get(std::size_t result, std::size_t play_faces) {
    const std::lock_guard lock(mutex_);
    const std::pair key(result, play_faces);
    for (auto it = open_.begin(); it != open_.end(); ++it) {
      if (it->first != key) continue;
      open_.splice(open_.begin(), open_, it);
      return open_.front().second;
    }
    Detail detail = full_detail(data_.size());
    if (play_faces > 0) {
      detail.shape_only = true;
      detail.max_faces = play_faces;
      detail.for_playing = true;
    }
    open_.emplace_front(key, data_.open(result, detail));
    if (open_.size() > kOpenReaders) open_.pop_back();
    return open_.front().second;
  }

 private:
  const PageData& data_;
  std::mutex mutex_;
  std::list<std::pair<std::pair<std::size_t, std::size_t>, std::shared_ptr<ResultReader>>> open_;
};

/// Of "play/100": 100,000; 0 for other parts.
std::size_t play_faces(const std::string& part) {
  static constexpr std::string_view kPrefix = "play/";
  if (!part.starts_with(kPrefix) || part.size() > kPrefix.size() + 3) return 0;
  const std::size_t thousands = std::stoul(part.substr(kPrefix.size()));
  return std::clamp<std::size_t>(1000 * thousands, 1000, kMostPlayFaces);
}

std::string part_type(const std::string& name) {
  if (name == "thumb") return "image/jpeg";
  if (name.starts_with("image/")) return "image/webp";
  return name.starts_with("holes/") ? "image/png" : "application/octet-stream";
}

}  // namespace

struct ViewServer::State {
  State(const fs::path& folder, const ViewOptions& options)
      : root(folder), data(folder, options.page), readers(data), experiment(data.experiment({})) {}

  void add_routes(GuardedServer& server);
  void answer_part(const httplib::Request& request, httplib::Response& response);
  void answer_list(const httplib::Request& request, httplib::Response& response);
  void answer_picture(const httplib::Request& request, httplib::Response& response);
  void answer_file(const httplib::Request& request, httplib::Response& response);
  std::string make_page() const;
  /// The number in the first group of a route; nothing when there is no such result.
  std::optional<std::size_t> result_of(const httplib::Request& request) const;

  fs::path root;
  PageData data;
  Readers readers;
  std::optional<ExperimentPage> experiment;
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

std::optional<std::size_t> ViewServer::State::result_of(const httplib::Request& request) const {
  const std::string digits = request.matches[1];
  if (digits.size() > 9) return std::nullopt;
  const auto result = static_cast<std::size_t>(std::stoul(digits));
  return result < data.size() ? std::optional(result) : std::nullopt;
}

void ViewServer::State::answer_part(const httplib::Request& request, httplib::Response& response) {
  const auto result = result_of(request);
  if (!result) return refuse(response, 404, "no such result");
  const std::string name = request.matches[2];
  const std::size_t playing = play_faces(name);
  const bool small = name == "thumb" && data.size() > 1;
  const auto reader = readers.get(*result, small ? kThumbFaces : playing);
  auto bytes = reader->part(playing > 0 ? "mesh" : name);
  if (!bytes) {
    std::string why = "not in this result: " + name;
    for (const auto& missing : reader->missing()) {
      if (missing.what == name || missing.what.starts_with(name + ".")) why = missing.why;
    }
    return refuse(response, 404, why);
  }
  response.set_content(std::move(*bytes), part_type(name));
}

void ViewServer::State::answer_list(const httplib::Request& request, httplib::Response& response) {
  const auto result = result_of(request);
  if (!result) return refuse(response, 404, "no such result");
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ServedFile& file : files_below(root, data.folder().results[*result].folder))
    list.push_back({{"path", file.path}, {"bytes", file.bytes}});
  response.set_content(json_line(list), "application/json");
}

/// As bytes only: a drawing that is opened by its address must not run as a page of this server.
void ViewServer::State::answer_picture(const httplib::Request& request,
                                       httplib::Response& response) {
  const std::string digits = request.matches[1];
  const std::size_t count = experiment ? experiment->pictures.size() : 0;
  const std::size_t index = digits.size() > 9 ? count : std::stoul(digits);
  if (index >= count) return refuse(response, 404, "no such picture");
  response.set_content(experiment->pictures[index], "application/octet-stream");
}

void ViewServer::State::answer_file(const httplib::Request& request, httplib::Response& response) {
  const auto file = file_inside(root, request.matches[1]);
  if (!file) return refuse(response, 404, "no such file in this folder");
  auto stream = std::make_shared<std::ifstream>(*file, std::ios::binary);
  std::error_code error;
  const auto size = fs::file_size(*file, error);
  if (!*stream || error) return refuse(response, 404, "the file cannot be read");
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

void ViewServer::State::add_routes(GuardedServer& server) {
  const std::string root_path = server.gate.path();
  server.Get(root_path, [this](const httplib::Request&, httplib::Response& response) {
    response.set_content(page, "text/html; charset=utf-8");
  });
  server.Get(root_path + R"(part/(\d+)/([a-z]+(?:/\d+)?))",
             [this](const auto& request, auto& response) { answer_part(request, response); });
  server.Get(root_path + R"(part/experiment/(\d+))",
             [this](const auto& request, auto& response) { answer_picture(request, response); });
  server.Get(root_path + "part/sequence/0",
             [this](const httplib::Request&, httplib::Response& response) {
               const std::string bytes = sequence_part(root);
               if (bytes.empty()) return refuse(response, 404, "this folder has no sequence.json");
               response.set_content(bytes, "application/octet-stream");
             });
  server.Get(root_path + R"(list/(\d+))",
             [this](const auto& request, auto& response) { answer_list(request, response); });
  server.Get(root_path + R"(files/(.+))",
             [this](const auto& request, auto& response) { answer_file(request, response); });
}

ViewServer::ViewServer(const fs::path& root, const ViewOptions& options)
    : PageServer(options.address, options.port, kViewAnswersAtOnce, "view"),
      state_(std::make_unique<State>(root, options)) {
  state_->data.require_content("view");
  state_->page = state_->make_page();
  state_->add_routes(server());
}

ViewServer::~ViewServer() = default;

std::size_t ViewServer::results() const { return state_->data.size(); }

}  // namespace pencilscan
