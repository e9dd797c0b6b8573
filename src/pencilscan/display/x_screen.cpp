#include "pencilscan/display/x_screen.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "pencilscan/core/error.h"
#include "pencilscan/display/screen_faults.h"

// Last: their macros (None, Status, Bool) are names elsewhere.
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/extensions/Xrandr.h>
#include <X11/extensions/dpms.h>

namespace pencilscan {

bool can_display() { return true; }

namespace {

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* value) const {
    Free(value);
  }
};
using Resources = std::unique_ptr<XRRScreenResources, Freed<XRRFreeScreenResources>>;
using OutputInfo = std::unique_ptr<XRROutputInfo, Freed<XRRFreeOutputInfo>>;
using CrtcInfo = std::unique_ptr<XRRCrtcInfo, Freed<XRRFreeCrtcInfo>>;
using Gamma = std::unique_ptr<XRRCrtcGamma, Freed<XRRFreeGamma>>;
template <typename T>
using XMemory = std::unique_ptr<T, Freed<XFree>>;

/// A failed request shall not end the program: whoever asked looks at the answer.
int ignore_error(Display*, XErrorEvent*) { return 0; }

double refresh_of(const XRRModeInfo& mode) {
  double rows = mode.vTotal;
  if ((mode.modeFlags & RR_DoubleScan) != 0) rows *= 2;
  if ((mode.modeFlags & RR_Interlace) != 0) rows /= 2;
  const double pixels = rows * mode.hTotal;
  return pixels > 0 ? static_cast<double>(mode.dotClock) / pixels : 0;
}

/// The name in a display's EDID: a descriptor of type 0xFC (VESA E-EDID).
std::string monitor_name(Display* display, RROutput output) {
  const Atom edid = XInternAtom(display, "EDID", True);
  if (edid == None) return "";
  Atom type = None;
  int format = 0;
  unsigned long count = 0;
  unsigned long left = 0;
  unsigned char* bytes = nullptr;
  if (XRRGetOutputProperty(display, output, edid, 0, 128, False, False, AnyPropertyType, &type,
                           &format, &count, &left, &bytes) != 0)
    return "";
  const XMemory<unsigned char> owner(bytes);
  if (bytes == nullptr || format != 8 || count < 128) return "";
  for (std::size_t at = 54; at + 18 <= 126; at += 18) {
    if (bytes[at] != 0 || bytes[at + 1] != 0 || bytes[at + 3] != 0xFC) continue;
    std::string name(reinterpret_cast<const char*>(bytes + at + 5), 13);
    name.resize(std::min(name.find('\n'), name.size()));
    name.erase(name.find_last_not_of(" \n") + 1);
    for (char& c : name)
      if (c < 0x20 || c > 0x7E) c = '?';
    return name;
  }
  return "";
}

bool is_identity(const XTransform& transform) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      if (transform.matrix[row][column] != (row == column ? XDoubleToFixed(1) : 0)) return false;
  return true;
}

const XRRModeInfo* mode_of(const XRRScreenResources& resources, RRMode id) {
  for (int i = 0; i < resources.nmode; ++i)
    if (resources.modes[i].id == id) return &resources.modes[i];
  return nullptr;
}

std::string title_of(Display* display, Window window) {
  char* text = nullptr;
  if (XFetchName(display, window, &text) == 0 || text == nullptr) return "";
  const XMemory<char> owner(text);
  return text;
}

}  // namespace

struct XScreen::State {
  Display* display = nullptr;
  Window root = None;

  [[nodiscard]] Resources resources() const {
    return Resources(XRRGetScreenResourcesCurrent(display, root));
  }
  [[nodiscard]] DisplayOutput describe(XRRScreenResources& all, RROutput id) const;
  [[nodiscard]] RRCrtc crtc_of(const std::string& output) const;
  /// The first title in a window and what it holds: window managers put frames around.
  [[nodiscard]] std::string title_within(Window window) const;
};

XScreen::XScreen(const std::string& display) : state_(std::make_unique<State>()) {
  XSetErrorHandler(ignore_error);
  state_->display = XOpenDisplay(display.empty() ? nullptr : display.c_str());
  if (state_->display == nullptr) {
    const char* named = std::getenv("DISPLAY");
    const std::string which = !display.empty() ? display : named != nullptr ? named : "";
    throw StageError(which.empty()
                         ? "there is no X server to show pictures on: DISPLAY is not set (on a "
                           "Wayland desktop choose the session \"on Xorg\")"
                         : "the X server " + which + " does not answer");
  }
  state_->root = DefaultRootWindow(state_->display);
  int major = 0;
  int minor = 0;
  if (XRRQueryVersion(state_->display, &major, &minor) == 0 || major * 10 + minor < 13) {
    XCloseDisplay(state_->display);
    throw StageError("this X server cannot tell its outputs: it lacks RandR 1.3");
  }
}

XScreen::~XScreen() { XCloseDisplay(state_->display); }

DisplayOutput XScreen::State::describe(XRRScreenResources& all, RROutput id) const {
  DisplayOutput output;
  const OutputInfo info(XRRGetOutputInfo(display, &all, id));
  if (!info) return output;
  output.name.assign(info->name, static_cast<std::size_t>(info->nameLen));
  output.connected = info->connection != RR_Disconnected;
  output.monitor = monitor_name(display, id);
  if (info->npreferred > 0 && info->nmode > 0) {
    if (const XRRModeInfo* mode = mode_of(all, info->modes[0])) {
      output.native_width = static_cast<int>(mode->width);
      output.native_height = static_cast<int>(mode->height);
    }
  }
  if (info->crtc == None) return output;
  const CrtcInfo crtc(XRRGetCrtcInfo(display, &all, info->crtc));
  if (!crtc || crtc->mode == None) return output;
  output.lit = true;
  output.x = crtc->x;
  output.y = crtc->y;
  output.width = static_cast<int>(crtc->width);
  output.height = static_cast<int>(crtc->height);
  output.turned = crtc->rotation != RR_Rotate_0;
  if (const XRRModeInfo* mode = mode_of(all, crtc->mode)) {
    output.mode_width = static_cast<int>(mode->width);
    output.mode_height = static_cast<int>(mode->height);
    output.refresh_hz = refresh_of(*mode);
    output.interlaced = (mode->modeFlags & RR_Interlace) != 0;
  }
  XRRCrtcTransformAttributes* transform = nullptr;
  if (XRRGetCrtcTransform(display, info->crtc, &transform) != 0 && transform != nullptr) {
    output.scaled = !is_identity(transform->currentTransform);
    XFree(transform);
  }
  return output;
}

std::vector<DisplayOutput> XScreen::outputs() const {
  std::vector<DisplayOutput> outputs;
  const Resources all = state_->resources();
  if (!all) return outputs;
  for (int i = 0; i < all->noutput; ++i) outputs.push_back(state_->describe(*all, all->outputs[i]));
  return outputs;
}

RRCrtc XScreen::State::crtc_of(const std::string& output) const {
  const Resources all = resources();
  for (int i = 0; all && i < all->noutput; ++i) {
    const OutputInfo info(XRRGetOutputInfo(display, all.get(), all->outputs[i]));
    if (info && output == std::string(info->name, static_cast<std::size_t>(info->nameLen)))
      return info->crtc;
  }
  return None;
}

cv::Mat XScreen::read(const DisplayOutput& output) const {
  Display* display = state_->display;
  const int screen = DefaultScreen(display);
  if (output.width <= 0 || output.height <= 0 || output.x < 0 || output.y < 0 ||
      output.x + output.width > DisplayWidth(display, screen) ||
      output.y + output.height > DisplayHeight(display, screen)) {
    // What Xlib knows of the size is that of the start: ask.
    XWindowAttributes root{};
    XGetWindowAttributes(display, state_->root, &root);
    if (output.width <= 0 || output.height <= 0 || output.x + output.width > root.width ||
        output.y + output.height > root.height)
      throw StageError("output " + output.name + " lies outside of the desktop");
  }
  XImage* image =
      XGetImage(display, state_->root, output.x, output.y, static_cast<unsigned>(output.width),
                static_cast<unsigned>(output.height), AllPlanes, ZPixmap);
  if (image == nullptr) throw StageError("output " + output.name + " cannot be read back");
  const std::unique_ptr<XImage, void (*)(XImage*)> owner(image,
                                                         [](XImage* x) { XDestroyImage(x); });
  if (image->bits_per_pixel != 32 || image->byte_order != LSBFirst)
    throw StageError("the X server has no true colours of 24 bits");
  cv::Mat rgb(output.height, output.width, CV_8UC3);
  for (int y = 0; y < rgb.rows; ++y) {
    const auto* from = reinterpret_cast<const unsigned char*>(image->data) +
                       static_cast<std::ptrdiff_t>(y) * image->bytes_per_line;
    auto* to = rgb.ptr<unsigned char>(y);
    for (int x = 0; x < rgb.cols; ++x, from += 4, to += 3) {
      to[0] = from[2];
      to[1] = from[1];
      to[2] = from[0];
    }
  }
  return rgb;
}

std::string XScreen::State::title_within(Window window) const {
  std::string title = title_of(display, window);
  if (!title.empty()) return title;
  Window root_window = None;
  Window parent = None;
  Window* children = nullptr;
  unsigned count = 0;
  if (XQueryTree(display, window, &root_window, &parent, &children, &count) == 0) return "";
  const XMemory<Window> owner(children);
  for (unsigned i = 0; i < count && title.empty(); ++i) title = title_within(children[i]);
  return title;
}

std::vector<std::string> XScreen::windows_over(const DisplayOutput& output,
                                               const std::string& ours) const {
  std::vector<std::string> over;
  Window root_window = None;
  Window parent = None;
  Window* children = nullptr;
  unsigned count = 0;
  if (XQueryTree(state_->display, state_->root, &root_window, &parent, &children, &count) == 0)
    return over;
  const XMemory<Window> owner(children);
  for (unsigned i = count; i-- > 0;) {  // topmost first
    XWindowAttributes place{};
    if (XGetWindowAttributes(state_->display, children[i], &place) == 0) continue;
    const bool meets = place.x < output.x + output.width && output.x < place.x + place.width &&
                       place.y < output.y + output.height && output.y < place.y + place.height;
    if (place.map_state != IsViewable || place.c_class == InputOnly || !meets) continue;
    const std::string title = state_->title_within(children[i]);
    if (title.starts_with(ours)) break;
    over.push_back(title.empty() ? "a window without a title" : title);
  }
  return over;
}

void XScreen::paint_desktop_black() {
  XSetWindowBackground(state_->display, state_->root,
                       BlackPixel(state_->display, DefaultScreen(state_->display)));
  XClearWindow(state_->display, state_->root);
  XSync(state_->display, False);
}

bool XScreen::alters_colors(const DisplayOutput& output) const {
  const RRCrtc crtc = state_->crtc_of(output.name);
  if (crtc == None) return false;
  const Gamma gamma(XRRGetCrtcGamma(state_->display, crtc));
  if (!gamma || gamma->size < 2) return false;
  // One step of an eight bit level is what could be seen.
  for (int i = 0; i < gamma->size; ++i) {
    const double plain = 65535.0 * i / (gamma->size - 1);
    for (const unsigned short* table : {gamma->red, gamma->green, gamma->blue})
      if (std::abs(table[i] - plain) > 257) return true;
  }
  return false;
}

struct ForeignWindow::State {
  Display* display = nullptr;
  Window window = None;
};

ForeignWindow::ForeignWindow(const XScreen& screen, const DisplayOutput& output,
                             const cv::Rect& where, const std::string& title)
    : state_(std::make_unique<State>()) {
  Display* display = state_->display = screen.state_->display;
  XSetWindowAttributes attributes{};
  attributes.override_redirect = True;
  attributes.background_pixel = 0xE0E0E0;
  state_->window = XCreateWindow(
      display, screen.state_->root, output.x + where.x, output.y + where.y,
      static_cast<unsigned>(where.width), static_cast<unsigned>(where.height), 0, CopyFromParent,
      InputOutput, CopyFromParent, CWOverrideRedirect | CWBackPixel, &attributes);
  XStoreName(display, state_->window, title.c_str());
  XMapRaised(display, state_->window);
  XSync(display, False);
}

ForeignWindow::~ForeignWindow() {
  XDestroyWindow(state_->display, state_->window);
  XSync(state_->display, False);
}

struct NightLight::State {
  Display* display = nullptr;
  RRCrtc crtc = None;
  Gamma before;
};

NightLight::NightLight(const XScreen& screen, const DisplayOutput& output)
    : state_(std::make_unique<State>()) {
  state_->display = screen.state_->display;
  state_->crtc = screen.state_->crtc_of(output.name);
  state_->before.reset(XRRGetCrtcGamma(state_->display, state_->crtc));
  const Gamma night(XRRGetCrtcGamma(state_->display, state_->crtc));
  for (int i = 0; i < night->size; ++i)
    night->blue[i] = static_cast<unsigned short>(night->blue[i] / 2);
  XRRSetCrtcGamma(state_->display, state_->crtc, night.get());
  XSync(state_->display, False);
}

NightLight::~NightLight() {
  XRRSetCrtcGamma(state_->display, state_->crtc, state_->before.get());
  XSync(state_->display, False);
}

struct PlainOutputs::Before {
  XScreen::State* screen = nullptr;
  std::vector<std::pair<RRCrtc, Gamma>> gamma;
  bool power_saving = false;
  int timeout = 0;
  int interval = 0;
  int blanking = 0;
  int exposures = 0;
};

PlainOutputs::PlainOutputs(XScreen& screen, std::span<const DisplayOutput> outputs)
    : before_(std::make_unique<Before>()) {
  before_->screen = screen.state_.get();
  Display* display = before_->screen->display;
  for (const DisplayOutput& output : outputs) {
    const RRCrtc crtc = before_->screen->crtc_of(output.name);
    if (crtc == None) continue;
    Gamma old(XRRGetCrtcGamma(display, crtc));
    if (!old || old->size < 2) continue;
    const Gamma plain(XRRAllocGamma(old->size));
    for (int i = 0; i < old->size; ++i)
      plain->red[i] = plain->green[i] = plain->blue[i] =
          static_cast<unsigned short>(std::lround(65535.0 * i / (old->size - 1)));
    XRRSetCrtcGamma(display, crtc, plain.get());
    before_->gamma.emplace_back(crtc, std::move(old));
  }
  int event = 0;
  int error = 0;
  if (DPMSQueryExtension(display, &event, &error) != 0 && DPMSCapable(display) != 0) {
    CARD16 level = 0;
    BOOL on = 0;
    if (DPMSInfo(display, &level, &on) != 0 && on != 0) {
      before_->power_saving = true;
      DPMSDisable(display);
    }
  }
  XGetScreenSaver(display, &before_->timeout, &before_->interval, &before_->blanking,
                  &before_->exposures);
  XSetScreenSaver(display, 0, 0, DontPreferBlanking, before_->exposures);
  XForceScreenSaver(display, ScreenSaverReset);
  XSync(display, False);
}

PlainOutputs::~PlainOutputs() {
  Display* display = before_->screen->display;
  for (const auto& [crtc, gamma] : before_->gamma) XRRSetCrtcGamma(display, crtc, gamma.get());
  if (before_->power_saving) DPMSEnable(display);
  XSetScreenSaver(display, before_->timeout, before_->interval, before_->blanking,
                  before_->exposures);
  XSync(display, False);
}

}  // namespace pencilscan
