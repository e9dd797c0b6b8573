#include "pencilscan/capture/file_cameras.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <set>
#include <thread>

#include "pencilscan/core/child_process.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/host_clock.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kLookNs = 20'000'000;  ///< between looks into a folder
constexpr Seconds kLongestShot{30};           ///< a program may take for a picture

bool is_picture(const fs::path& path) {
  const std::string ending = lower_case(path.extension().string());
  static const std::set<std::string> known{".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp"};
  return known.contains(ending) && !path.filename().string().starts_with('.');
}

/// The picture of a file as a frame; `size`: what it must have, where known.
CameraFrame frame_of_file(const fs::path& path, const CameraSettings& settings) {
  CameraFrame frame;
  frame.arrival_ns = host_now_ns();
  try {
    frame.image = read_stored_image(path);
  } catch (const InputError& error) {
    frame.status = PictureStatus::kUnreadable;
    frame.remark = error.what();
    return frame;
  }
  if (settings.width > 0 &&
      (frame.image.cols != settings.width || frame.image.rows != settings.height)) {
    frame.status = PictureStatus::kWrongSize;
    frame.remark = "its pictures are " + size_text(frame.image.cols, frame.image.rows) +
                   ", the rig says " + size_text(settings.width, settings.height);
    frame.image.release();
  }
  return frame;
}

class FolderCamera final : public CameraDevice {
 public:
  explicit FolderCamera(const fs::path& folder) : folder_(folder) {
    if (!fs::is_directory(folder))
      throw InputError("camera", "folder", folder.string(), "must be a folder");
    info_ = {"folder:" + folder.string(), "pictures of another program", "", true};
  }

  const CameraInfo& info() const override { return info_; }
  CameraSettings configure(const CameraSettings& settings) override {
    if (settings.trigger != Trigger::kFree && settings.trigger != Trigger::kSoftware)
      throw InputError(info_.address, "trigger", to_string(settings.trigger),
                       "must be free or software: the folder's program has its own ways");
    return settings_ = settings;
  }
  void start() override {
    known_.clear();
    for (const auto& [path, size] : pictures()) known_.insert(path);
    sizes_.clear();
    unreadable_ns_.clear();
    number_ = 0;
    running_ = true;
  }
  void stop() override { running_ = false; }
  void trigger() override {
    write_text(folder_ / "request.txt", std::to_string(requests_++) + "\n");
  }

  std::optional<CameraFrame> next(Seconds patience) override {
    const std::int64_t until = host_now_ns() + static_cast<std::int64_t>(1e9 * patience.count());
    while (running_) {
      const std::int64_t now = host_now_ns();
      if (now >= next_look_ns_) {
        if (auto frame = look()) return frame;
        next_look_ns_ = now + kLookNs;
      }
      if (now >= until) return std::nullopt;
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(until, next_look_ns_) - now));
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::map<fs::path, std::uintmax_t> pictures() const {
    std::map<fs::path, std::uintmax_t> found;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder_, ignored))
      if (is_picture(entry.path()) && entry.is_regular_file(ignored))
        found[entry.path()] = entry.file_size(ignored);
    return found;
  }

  /// The oldest new file that did not grow since the last look.
  std::optional<CameraFrame> look() {
    const auto now = pictures();
    std::optional<fs::path> oldest;
    fs::file_time_type oldest_time{};
    for (const auto& [path, size] : now) {
      if (known_.contains(path)) continue;
      std::error_code error;
      const auto time = fs::last_write_time(path, error);
      if (!error && (!oldest || time < oldest_time)) {
        oldest = path;
        oldest_time = time;
      }
    }
    if (!oldest) return std::nullopt;
    const std::uintmax_t size = now.at(*oldest);
    const auto before = sizes_.find(*oldest);
    const bool settled = before != sizes_.end() && before->second == size;
    sizes_[*oldest] = size;
    if (!settled) return std::nullopt;
    CameraFrame frame = frame_of_file(*oldest, settings_);
    // One that is still being written is looked at again, for a while.
    if (frame.status == PictureStatus::kUnreadable) {
      const std::int64_t now_ns = host_now_ns();
      const auto since_ns = unreadable_ns_.try_emplace(*oldest, now_ns).first->second;
      if (Seconds(1e-9 * static_cast<double>(now_ns - since_ns)) < kLongestShot)
        return std::nullopt;
    }
    unreadable_ns_.erase(*oldest);
    known_.insert(*oldest);
    sizes_.erase(*oldest);
    struct stat status {};
    if (::stat(oldest->c_str(), &status) == 0)
      frame.timestamp_ns =
          1'000'000'000LL * status.st_mtim.tv_sec + status.st_mtim.tv_nsec - utc_minus_host_ns();
    frame.number = number_++;
    return frame;
  }

  fs::path folder_;
  CameraInfo info_;
  CameraSettings settings_;
  std::set<fs::path> known_;
  std::map<fs::path, std::uintmax_t> sizes_;
  std::map<fs::path, std::int64_t> unreadable_ns_;  ///< since when
  std::int64_t next_look_ns_ = 0;
  std::int64_t number_ = 0;
  std::size_t requests_ = 0;
  bool running_ = false;
};

class CommandCamera final : public CameraDevice {
 public:
  explicit CommandCamera(const std::vector<std::string>& words)
      : words_(words),
        folder_(fs::temp_directory_path() /
                ("pencilscan_camera_" + std::to_string(::getpid()) + "_" +
                 std::to_string(reinterpret_cast<std::uintptr_t>(this)))) {
    const bool names_file = std::any_of(words.begin(), words.end(), [](const std::string& word) {
      return word.find(kFile) != std::string::npos;
    });
    if (words.empty() || !names_file)
      throw InputError("camera", "command", words.empty() ? "" : words.front(),
                       "must be a program with {file} among its arguments");
    info_ = {"command:" + words.front(), "pictures of a program", "", true};
    fs::create_directories(folder_);
    fs::permissions(folder_, fs::perms::owner_all);
  }
  ~CommandCamera() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  const CameraInfo& info() const override { return info_; }
  CameraSettings configure(const CameraSettings& settings) override {
    if (settings.trigger != Trigger::kSoftware)
      throw InputError(info_.address, "trigger", to_string(settings.trigger),
                       "must be software: a command takes one picture at a time");
    return settings_ = settings;
  }
  void start() override { wanted_ = 0; }
  void stop() override { wanted_ = 0; }
  void trigger() override { ++wanted_; }

  std::optional<CameraFrame> next(Seconds patience) override {
    if (wanted_ == 0) {
      std::this_thread::sleep_for(patience);
      return std::nullopt;
    }
    --wanted_;
    const fs::path file = folder_ / "picture.jpg";
    std::error_code ignored;
    fs::remove(file, ignored);
    std::vector<std::string> words = words_;
    for (std::string& word : words)
      if (const auto at = word.find(kFile); at != std::string::npos)
        word.replace(at, std::string(kFile).size(), file.string());
    const std::int64_t began = host_now_ns();
    ChildProcess program(words);
    const auto code = program.wait(kLongestShot);
    const bool made = fs::exists(file, ignored);
    CameraFrame frame;
    if (code == 0 && made) {
      frame = frame_of_file(file, settings_);
    } else {
      program.stop();
      frame.status = PictureStatus::kUnreadable;
      frame.remark = code ? "its program ended with " + std::to_string(*code) +
                                (made ? "" : " and made no file")
                          : "its program took longer than half a minute";
      frame.arrival_ns = host_now_ns();
    }
    frame.timestamp_ns = began;
    frame.number = number_++;
    return frame;
  }

 private:
  static constexpr const char* kFile = "{file}";
  std::vector<std::string> words_;
  fs::path folder_;
  CameraInfo info_;
  CameraSettings settings_;
  std::size_t wanted_ = 0;
  std::int64_t number_ = 0;
};

}  // namespace

std::unique_ptr<CameraDevice> open_folder_camera(const fs::path& folder) {
  return std::make_unique<FolderCamera>(folder);
}

std::unique_ptr<CameraDevice> open_command_camera(const std::vector<std::string>& words) {
  return std::make_unique<CommandCamera>(words);
}

}  // namespace pencilscan
