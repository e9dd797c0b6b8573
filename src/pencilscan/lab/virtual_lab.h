#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/capture/fake_cameras.h"
#include "pencilscan/capture/lab_file.h"
#include "pencilscan/display/dummy_screen.h"
#include "pencilscan/display/shown_watch.h"
#include "pencilscan/lab/virtual_room.h"

namespace pencilscan {

/// A laboratory without devices. An X server without hardware has one output per projector; what an
/// output really shows is the light of its projector in a simulated room; what the cameras see of
/// the room comes over the network from GigE Vision cameras that are programs. Who shows pictures
/// and takes them cannot tell it from a real one.
class VirtualLab {
 public:
  /// The process is in a network of its own with an address per camera
  /// (core/private_network.h), and gets DISPLAY set. `rig`: the true one, at most 16 projectors.
  /// `folder`: for the X server's files. StageError as of DummyScreen and FakeCamera.
  VirtualLab(const Rig& rig, const std::filesystem::path& folder,
             const PhotographyOptions& photo = {});

  [[nodiscard]] VirtualRoom& room() { return room_; }
  [[nodiscard]] const DummyScreen& screen() const { return screen_; }
  /// lab.json for it: cameras, outputs, raw pictures behind the rig's mosaics, a picture for every
  /// software trigger, exposures of one period.
  [[nodiscard]] Lab lab_file() const;
  [[nodiscard]] FakeCamera& camera(std::size_t camera) { return *cameras_[camera]; }
  void pull_cable(std::size_t camera) { cameras_[camera].reset(); }

 private:
  [[nodiscard]] std::unique_ptr<FakeCamera> make_camera(std::size_t camera);

  DummyScreen screen_;
  VirtualRoom room_;
  ShownWatch watch_;
  std::vector<std::unique_ptr<FakeCamera>> cameras_;
};

/// The name of an output of VirtualLab.
[[nodiscard]] std::string virtual_output(std::size_t projector);

}  // namespace pencilscan
