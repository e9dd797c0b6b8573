#pragma once

// What Aravis says and how a camera is left; of the back end alone.

#include <arv.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace pencilscan {

/// Gives back what Aravis gave.
struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};

/// Collects an error of Aravis.
class Failure {
 public:
  Failure() = default;
  ~Failure() { g_clear_error(&error_); }
  Failure(const Failure&) = delete;
  Failure& operator=(const Failure&) = delete;
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  [[nodiscard]] bool failed() const { return error_ != nullptr; }
  [[nodiscard]] std::string text() const { return failed() ? error_->message : ""; }
  /// The camera did not answer at all.
  [[nodiscard]] bool silent() const {
    return g_error_matches(error_, ARV_DEVICE_ERROR, ARV_DEVICE_ERROR_TIMEOUT) != 0 ||
           g_error_matches(error_, ARV_DEVICE_ERROR, ARV_DEVICE_ERROR_NOT_CONNECTED) != 0;
  }

 private:
  GError* error_ = nullptr;
};

inline std::string text_of(const char* text) { return text == nullptr ? "" : text; }

/// A camera's features as they were found, put back at the end.
class FeatureKeeper {
 public:
  explicit FeatureKeeper(ArvDevice* device);
  ~FeatureKeeper();
  FeatureKeeper(const FeatureKeeper&) = delete;
  FeatureKeeper& operator=(const FeatureKeeper&) = delete;
  /// The camera was opened anew: what was found at first is put back there.
  void belongs_to(ArvDevice* device) {
    device_ = device;
    gone_ = false;
  }
  /// Puts nothing back: it does not answer.
  void leave() { gone_ = true; }

 private:
  struct TriggerValue {
    std::string trigger;
    std::string name;
    std::string value;
  };

  [[nodiscard]] std::optional<std::string> read(const std::string& name) const;
  void write(const std::string& name, const std::string& value) const;
  [[nodiscard]] std::vector<std::string> triggers() const;

  ArvDevice* device_;
  mutable bool gone_ = false;  ///< asking for every feature in turn would take minutes
  std::vector<std::pair<std::string, std::string>> found_;
  std::vector<TriggerValue> triggers_;
  std::optional<std::string> selector_;
};

}  // namespace pencilscan
