#include "pencilscan/capture/aravis_features.h"

#include <array>

namespace pencilscan {
namespace {

/// Whatever we may set, in the order in which it may be set back: switches before values, what
/// limits others before these. Names of the standard (SFNC) and older ones.
constexpr std::array kFeatures{"PixelFormat",
                               "OffsetX",
                               "OffsetY",
                               "Width",
                               "Height",
                               "OffsetX",
                               "OffsetY",
                               "ExposureAuto",
                               "ExposureMode",
                               "GainAuto",
                               "BalanceWhiteAuto",
                               "GammaEnable",
                               "Gamma",
                               "AcquisitionMode",
                               "AcquisitionFrameRateEnable",
                               "AcquisitionFrameRate",
                               "AcquisitionFrameRateAbs",
                               "ExposureTime",
                               "ExposureTimeAbs",
                               "ExposureTimeRaw",
                               "Gain",
                               "GainRaw",
                               "PtpEnable",
                               "GevIEEE1588",
                               "GevSCPSPacketSize"};

ArvGcFeatureNode* node(ArvDevice* device, const std::string& name) {
  ArvGcNode* found = arv_device_get_feature(device, name.c_str());
  return ARV_IS_GC_FEATURE_NODE(found) ? ARV_GC_FEATURE_NODE(found) : nullptr;
}

}  // namespace

FeatureKeeper::FeatureKeeper(ArvDevice* device) : device_(device) {
  for (const char* name : kFeatures)
    if (const auto value = read(name)) found_.emplace_back(name, *value);
  selector_ = read("TriggerSelector");
  for (const std::string& trigger : triggers()) {
    write("TriggerSelector", trigger);
    for (const char* name : {"TriggerMode", "TriggerSource", "TriggerActivation"})
      if (const auto value = read(name)) triggers_.push_back({trigger, name, *value});
  }
  if (selector_) write("TriggerSelector", *selector_);
}

FeatureKeeper::~FeatureKeeper() {
  for (const auto& [name, value] : found_)
    if (read(name) != value) write(name, value);
  for (const TriggerValue& entry : triggers_) {
    write("TriggerSelector", entry.trigger);
    if (read(entry.name) != entry.value) write(entry.name, entry.value);
  }
  if (selector_) write("TriggerSelector", *selector_);
}

std::optional<std::string> FeatureKeeper::read(const std::string& name) const {
  ArvGcFeatureNode* feature = gone_ ? nullptr : node(device_, name);
  Failure failure;
  if (feature == nullptr || arv_gc_feature_node_is_available(feature, failure.out()) == 0 ||
      failure.failed())
    return std::nullopt;
  const char* value = arv_gc_feature_node_get_value_as_string(feature, failure.out());
  gone_ = failure.silent();
  if (failure.failed() || value == nullptr) return std::nullopt;
  return value;
}

void FeatureKeeper::write(const std::string& name, const std::string& value) const {
  ArvGcFeatureNode* feature = gone_ ? nullptr : node(device_, name);
  Failure failure;
  if (feature == nullptr) return;
  arv_gc_feature_node_set_value_from_string(feature, value.c_str(), failure.out());
  gone_ = failure.silent();
}

std::vector<std::string> FeatureKeeper::triggers() const {
  guint count = 0;
  Failure failure;
  const char** names = arv_device_dup_available_enumeration_feature_values_as_strings(
      device_, "TriggerSelector", &count, failure.out());
  std::vector<std::string> result;
  for (guint i = 0; names != nullptr && i < count; ++i) result.emplace_back(names[i]);
  g_free(names);
  return result;
}

}  // namespace pencilscan
