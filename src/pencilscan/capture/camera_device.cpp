#include "pencilscan/capture/camera_device.h"

namespace pencilscan {

std::string to_string(PictureStatus status) {
  switch (status) {
    case PictureStatus::kComplete:
      return "complete";
    case PictureStatus::kLostPackets:
      return "packets lost";
    case PictureStatus::kAborted:
      return "aborted";
    case PictureStatus::kWrongSize:
      return "wrong size";
    case PictureStatus::kUnreadable:
      return "unreadable";
  }
  return "";
}

std::string trouble_of(const CameraFrame& frame) {
  if (!frame.remark.empty()) return frame.remark;
  switch (frame.status) {
    case PictureStatus::kComplete:
    case PictureStatus::kLostPackets:
      return "";
    case PictureStatus::kAborted:
      return "the camera or its driver gave pictures up";
    case PictureStatus::kWrongSize:
      return "its pictures have another size or pixel format than was agreed";
    case PictureStatus::kUnreadable:
      return "its pictures cannot be read";
  }
  return "";
}

std::optional<Trigger> trigger_from_text(const std::string& text) {
  for (const Trigger trigger : {Trigger::kFree, Trigger::kSoftware, Trigger::kWire, Trigger::kPtp})
    if (text == to_string(trigger)) return trigger;
  return std::nullopt;
}

std::string to_string(Trigger trigger) {
  switch (trigger) {
    case Trigger::kFree:
      return "free";
    case Trigger::kSoftware:
      return "software";
    case Trigger::kWire:
      return "wire";
    case Trigger::kPtp:
      return "ptp";
  }
  return "";
}

}  // namespace pencilscan
