#include "pencilscan/display/dummy_screen.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <random>
#include <sstream>
#include <utility>

#include "pencilscan/core/child_process.h"
#include "pencilscan/core/error.h"
#include "pencilscan/display/x_screen.h"
#include "pencilscan/io/file.h"

// Last: their macros are names elsewhere.
#include <X11/Xlib.h>
#include <X11/extensions/Xrandr.h>

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostOutputs = 16;
constexpr int kSmallestDesktop = 64;  ///< px: the driver refuses less
constexpr ChildProcess::Seconds kStart{20};

struct Size {
  int width = 0;
  int height = 0;
};

/// Without Debian's wrapper, which looks for a console.
std::string server_program() {
  const std::string debian = "/usr/lib/xorg/Xorg";
  return fs::exists(debian) ? debian : "Xorg";
}

/// All outputs side by side.
Size desktop_of(const std::vector<DummyScreen::Output>& outputs) {
  Size size;
  for (const DummyScreen::Output& output : outputs) {
    size.width += output.width;
    size.height = std::max(size.height, output.height);
  }
  return {std::max(size.width, kSmallestDesktop), std::max(size.height, kSmallestDesktop)};
}

/// Neither devices nor terminals nor power saving. The driver starts with a mode of its own, for
/// which the memory must do as well.
std::string configuration(Size desktop) {
  desktop.width = std::max(desktop.width, 2048);
  desktop.height = std::max(desktop.height, 2048);
  const long kilobytes = 4L * desktop.width * desktop.height / 1024 + 16384;
  std::ostringstream text;
  text << "Section \"ServerFlags\"\n Option \"AutoAddDevices\" \"false\"\n"
          " Option \"AutoEnableDevices\" \"false\"\n Option \"DontVTSwitch\" \"true\"\n"
          " Option \"BlankTime\" \"0\"\n Option \"StandbyTime\" \"0\"\n"
          " Option \"SuspendTime\" \"0\"\n Option \"OffTime\" \"0\"\nEndSection\n"
       << "Section \"Device\"\n Identifier \"device\"\n Driver \"dummy\"\n VideoRam " << kilobytes
       << "\nEndSection\n"
       << "Section \"Monitor\"\n Identifier \"monitor\"\n HorizSync 5.0 - 1000.0\n"
          " VertRefresh 5.0 - 200.0\nEndSection\n"
       << "Section \"Screen\"\n Identifier \"screen\"\n Device \"device\"\n Monitor \"monitor\"\n"
          " DefaultDepth 24\n SubSection \"Display\"\n  Depth 24\n  Virtual "
       << desktop.width << " " << desktop.height << "\n EndSubSection\nEndSection\n";
  return text.str();
}

/// The file of the cookie that lets clients in, for any display (family 0xFFFF, as xauth writes
/// it).
std::string authority() {
  const std::string name = "MIT-MAGIC-COOKIE-1";
  std::random_device random;
  std::string bytes("\xff\xff", 2);
  const auto field = [&](const std::string& value) {
    bytes += static_cast<char>(value.size() >> 8U);
    bytes += static_cast<char>(value.size() & 0xFFU);
    bytes += value;
  };
  field("");
  field("");
  field(name);
  std::string cookie;
  for (int i = 0; i < 16; ++i) cookie += static_cast<char>(random() & 0xFFU);
  field(cookie);
  return bytes;
}

/// A mode of this size and refresh; blanking as short as the driver takes it.
RRMode make_mode(Display* display, const DummyScreen::Output& output) {
  std::ostringstream name;
  name << "pencilscan-" << output.width << "x" << output.height << "-" << output.refresh_hz;
  const std::string text = name.str();
  XRRScreenResources* all = XRRGetScreenResourcesCurrent(display, DefaultRootWindow(display));
  std::optional<RRMode> known;
  for (int i = 0; i < all->nmode; ++i)
    if (text == all->modes[i].name) known = all->modes[i].id;
  XRRFreeScreenResources(all);
  if (known) return *known;
  XRRModeInfo* mode = XRRAllocModeInfo(text.c_str(), static_cast<int>(text.size()));
  mode->width = static_cast<unsigned>(output.width);
  mode->height = static_cast<unsigned>(output.height);
  mode->hSyncStart = mode->width + 8;
  mode->hSyncEnd = mode->width + 16;
  mode->hTotal = mode->width + 32;
  mode->vSyncStart = mode->height + 1;
  mode->vSyncEnd = mode->height + 3;
  mode->vTotal = mode->height + 8;
  mode->dotClock =
      static_cast<unsigned long>(std::lround(output.refresh_hz * mode->hTotal * mode->vTotal));
  const RRMode id = XRRCreateMode(display, DefaultRootWindow(display), mode);
  XRRFreeModeInfo(mode);
  return id;
}

void lay_out(Display* display, const std::vector<DummyScreen::Output>& outputs) {
  const Window root = DefaultRootWindow(display);
  XRRScreenResources* all = XRRGetScreenResourcesCurrent(display, root);
  if (all == nullptr || all->noutput < static_cast<int>(outputs.size()) ||
      all->ncrtc < static_cast<int>(outputs.size()))
    throw StageError(
        "the X server's driver \"dummy\" has too few outputs: it must be 0.4 or newer");
  for (int i = 0; i < all->ncrtc; ++i)
    XRRSetCrtcConfig(display, all, all->crtcs[i], CurrentTime, 0, 0, None, RR_Rotate_0, nullptr, 0);
  const Size size = desktop_of(outputs);
  XRRSetScreenSize(display, root, size.width, size.height, size.width / 4, size.height / 4);
  int x = 0;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const RRMode mode = make_mode(display, outputs[i]);
    XRRAddOutputMode(display, all->outputs[i], mode);
    XRRSetCrtcConfig(display, all, all->crtcs[i], CurrentTime, x, 0, mode, RR_Rotate_0,
                     &all->outputs[i], 1);
    x += outputs[i].width;
  }
  XRRFreeScreenResources(all);
  XSync(display, False);
}

}  // namespace

int free_display_number(const fs::path& folder) {
  int number = 0;
  const auto taken = [&] {
    const std::string text = std::to_string(number);
    std::error_code ignored;  // symlink_status: also of what points nowhere
    return fs::exists(fs::symlink_status(folder / ".X11-unix" / ("X" + text), ignored)) ||
           fs::exists(fs::symlink_status(folder / (".X" + text + "-lock"), ignored));
  };
  while (taken()) ++number;
  return number;
}

struct DummyScreen::State {
  std::unique_ptr<ChildProcess> server;
  std::string display;
  fs::path authority;
};

DummyScreen::DummyScreen(const fs::path& folder, const std::vector<Output>& outputs)
    : state_(std::make_unique<State>()) {
  if (outputs.empty() || outputs.size() > kMostOutputs)
    throw StageError("an X server without hardware has 1 to 16 outputs");
  fs::create_directories(folder);
  const fs::path here = fs::absolute(folder);
  write_text(here / "xorg.conf", configuration(desktop_of(outputs)));
  state_->authority = here / "authority";
  write_text(state_->authority, authority());
  fs::permissions(state_->authority, fs::perms::owner_read | fs::perms::owner_write);
  ChildProcess::Options options;
  options.piped = true;
  options.error_file = (here / "server.txt").string();
  // Somebody else may take the number meanwhile: then there is another one.
  for (int number = -1; state_->display.empty();) {
    const int before = std::exchange(number, free_display_number());
    if (number == before)
      throw StageError(
          "an X server without hardware did not start (is xserver-xorg-video-dummy "
          "installed?); its log is " +
          (here / "server.log").string());
    state_->server = std::make_unique<ChildProcess>(
        std::vector<std::string>{server_program(), ":" + std::to_string(number), "-displayfd", "1",
                                 "-config", (here / "xorg.conf").string(), "-logfile",
                                 (here / "server.log").string(), "-auth",
                                 state_->authority.string(), "-nolisten", "tcp", "-noreset",
                                 "-novtswitch", "-sharevts", "-keeptty"},
        options);
    if (const auto said = state_->server->read_line(kStart); said && !said->empty())
      state_->display = ":" + *said;
  }
  enter();
  const std::unique_ptr<Display, int (*)(Display*)> display(XOpenDisplay(state_->display.c_str()),
                                                            XCloseDisplay);
  if (!display) throw StageError("the X server " + state_->display + " does not answer");
  lay_out(display.get(), outputs);
  // Newly lit outputs read back black, whatever is drawn, until the desktop was painted once.
  XScreen(state_->display).paint_desktop_black();
}

DummyScreen::~DummyScreen() = default;

const std::string& DummyScreen::display() const { return state_->display; }

void DummyScreen::enter() const {
  ::setenv("DISPLAY", state_->display.c_str(), 1);
  ::setenv("XAUTHORITY", state_->authority.c_str(), 1);
}

}  // namespace pencilscan
