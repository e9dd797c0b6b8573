#include "pencilscan/pipeline/run_folder.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/hash.h"
#include "pencilscan/io/image.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr const char* kInputsFile = "inputs.json";
constexpr const char* kFrameInputFile = "input.json";
constexpr const char* kReportFile = "report.json";
constexpr const char* kFailureFile = "failure.json";
constexpr const char* kMakingFolder = ".making";  ///< holds the folders of frames in the making

std::string text_of(const json& object, const char* key) {
  const json value = object.is_object() ? object.value(key, json()) : json();
  return value.is_string() ? value.get<std::string>() : "";
}

/// As read_json(), nothing for what is missing or broken.
std::optional<json> json_if_any(const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return std::nullopt;
  try {
    return read_json(file);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "host";
}

/// No result has one; a power failure leaves files that were never written to the disk so.
bool has_empty_file(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored) && it->file_size(ignored) == 0) return true;
  }
  return false;
}

}  // namespace

std::string RunInputs::settings() const {
  return hex(hash_bytes(program + "\n" + rig + "\n" + options + "\n" + refined_from));
}

bool has_run_inputs(const fs::path& out) {
  std::error_code ignored;
  return fs::exists(out / kInputsFile, ignored);
}

bool is_new_run(const fs::path& out) {
  std::error_code error;
  if (!fs::exists(out, error)) return true;
  const std::string in_the_making = std::string(kInputsFile) + ".part";
  for (fs::directory_iterator it(out, error), end; !error && it != end; it.increment(error)) {
    if (!it->path().filename().string().starts_with(in_the_making)) return false;
  }
  return !error;
}

RunInputs read_run_inputs(const fs::path& out) {
  const fs::path file = out / kInputsFile;
  const json object = read_json(file);
  RunInputs inputs;
  inputs.program = text_of(object, "program");
  inputs.rig = text_of(object, "rig");
  inputs.options = text_of(object, "options");
  inputs.refined_from = text_of(object, "refined_from");
  const json frames = object.is_object() ? object.value("frames", json()) : json();
  if (!frames.is_array()) return inputs;  // of an earlier version
  for (const json& name : frames) {
    if (!name.is_string())
      throw InputError(file.string(), "frames", name.dump(), "must be the name of a frame");
    inputs.frames.push_back(name.get<std::string>());
  }
  return inputs;
}

void write_run_inputs(const fs::path& out, const RunInputs& inputs) {
  ordered_json object;
  object["program"] = inputs.program;
  object["rig"] = inputs.rig;
  object["options"] = inputs.options;
  if (!inputs.refined_from.empty()) object["refined_from"] = inputs.refined_from;
  object["settings"] = inputs.settings();
  object["frames"] = inputs.frames;
  const std::string text = object.dump(1) + "\n";
  const fs::path file = out / kInputsFile;
  std::error_code ignored;
  if (fs::exists(file, ignored) && read_file(file) == text) return;
  write_text(file, text);
}

FrameStatus frame_status(const fs::path& out, const std::string& frame, const std::string& settings,
                         const std::optional<std::string>& images) {
  const fs::path folder = out / frame;
  std::error_code ignored;
  if (!fs::exists(folder, ignored)) return {};
  const bool has_report = fs::exists(folder / kReportFile, ignored);
  const bool has_failure = fs::exists(folder / kFailureFile, ignored);
  if (!has_report && !has_failure) return {};
  const auto found = json_if_any(folder / kFrameInputFile);
  FrameStatus status;
  // A power failure left it empty; or something else made the folder.
  if (!found && fs::exists(folder / kFrameInputFile, ignored)) return {};
  const json input = found.value_or(json());
  // Of other pictures, a failure is nothing to keep.
  if (text_of(input, "settings") != settings ||
      (has_report && images && text_of(input, "images") != *images)) {
    status.state = FrameState::kOther;
    return status;
  }
  if (has_report) {
    if (!has_empty_file(folder)) status.state = FrameState::kDone;
    return status;
  }
  const json failure = json_if_any(folder / kFailureFile).value_or(json());
  status.state = FrameState::kFailed;
  status.failure = {text_of(failure, "reason"),
                    failure.is_object() && failure.value("is_passing", json(false)) == true};
  return status;
}

FrameFolder::FrameFolder(const fs::path& out, std::string frame, const std::string& settings,
                         const std::string& images)
    : out_(out), frame_(std::move(frame)) {
  static std::atomic<unsigned> counter{0};
  // Another program that leaves may remove the folder above, or take a new folder for an abandoned
  // one before it is locked.
  constexpr int kTrials = 20;
  for (int trial = 0;; ++trial) {
    path_ = out_ / kMakingFolder /
            (frame_ + "-" + host_name() + "-" + std::to_string(::getpid()) + "-" +
             std::to_string(counter++));
    std::error_code error;
    fs::create_directories(path_, error);
    if (!error) {
      lock_ = FolderLock(path_);
      if (!lock_.is_taken()) break;
      error = std::error_code(lock_.error(), std::generic_category());
    }
    if (trial == kTrials) throw StageError(path_.string() + ": cannot be made: " + error.message());
  }
  try {
    write_json(path_ / kFrameInputFile, {{"settings", settings}, {"images", images}},
               Durability::kProcess);
  } catch (const std::exception&) {
    leave();
    throw;
  }
}

FrameFolder::~FrameFolder() { leave(); }

void FrameFolder::leave() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
  path_.clear();
  lock_.release();
  fs::remove(out_ / kMakingFolder, ignored);  // the last one does it
}

void FrameFolder::publish() {
  const fs::path target = out_ / frame_;
  const auto rename = [&] { return ::rename(path_.c_str(), target.c_str()) == 0 ? 0 : errno; };
  int error = rename();
  if (error == ENOTEMPTY || error == EEXIST) {
    // Somebody else published it, or it holds nothing that counts.
    if (fs::exists(target / kReportFile)) return leave();
    fs::remove_all(target);
    error = rename();
  }
  if (error != 0)
    throw StageError(target.string() + ": cannot be written: " + std::strerror(error));
  path_.clear();
  leave();
}

void write_failure(const fs::path& out, const std::string& frame, const std::string& settings,
                   const std::string& images, const FrameFailure& failure) {
  FrameFolder folder(out, frame, settings, images);
  write_json(folder.path() / kFailureFile,
             {{"frame", frame}, {"reason", failure.reason}, {"is_passing", failure.is_passing}},
             Durability::kProcess);
  folder.publish();
}

void check_replaceable(const fs::path& out, const std::string& frame) {
  // Of a result that a killed program was removing, anything may be left, but no picture: those lie
  // in folders of their own.
  if (FolderImages(out / frame).stems().empty()) return;
  throw InputError("--out", "", out.string(),
                   "holds pictures in " + frame + ", which no result does: they are not replaced");
}

std::optional<std::string> strays_warning(const fs::path& out,
                                          const std::vector<std::string>& frames) {
  const std::set<std::string> known(frames.begin(), frames.end());
  std::vector<std::string> strays;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(out)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with('.') && !known.contains(name) &&
        fs::exists(entry.path() / kFrameInputFile, ignored))
      strays.push_back(name);
  }
  if (strays.empty()) return std::nullopt;
  std::sort(strays.begin(), strays.end());
  return out.string() + " holds results of frames that the input does not have: " +
         name_list(strays, kNamedFrames) +
         "; report takes them in, so remove their folders or name a new output folder";
}

void remove_abandoned(const fs::path& out) {
  std::error_code error;
  std::vector<fs::path> folders;
  for (fs::directory_iterator it(out / kMakingFolder, error), end; !error && it != end;
       it.increment(error))
    folders.push_back(it->path());
  for (const fs::path& folder : folders) {
    const FolderLock lock(folder);
    if (lock.is_held()) fs::remove_all(folder, error);
  }
  fs::remove(out / kMakingFolder, error);
}

}  // namespace pencilscan
