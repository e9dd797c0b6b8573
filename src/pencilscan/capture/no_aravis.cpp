// In the place of aravis_cameras.cpp and fake_cameras.cpp where Aravis is missing.
#include "pencilscan/capture/aravis_cameras.h"
#include "pencilscan/capture/fake_cameras.h"
#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

[[noreturn]] void fail() {
  throw StageError(
      "this pencilscan was built without GigE Vision and USB3 Vision: it needs Aravis "
      "(script/bootstrap --lab, then script/build)");
}

}  // namespace

bool has_aravis() { return false; }

std::vector<CameraInfo> list_aravis_cameras() { return {}; }

std::unique_ptr<CameraDevice> open_aravis_camera(const std::string&) { fail(); }

struct FakeCamera::State {};
FakeCamera::FakeCamera(FakeCameraScript) { fail(); }
FakeCamera::~FakeCamera() = default;
void FakeCamera::set_lost_packets(double) { fail(); }
void FakeCamera::set_clock(double) { fail(); }
void FakeCamera::pulse() { fail(); }

}  // namespace pencilscan
