// In the place of x_screen.cpp and projector_windows.cpp where SDL2 or the X libraries are missing.
#include "pencilscan/core/error.h"
#include "pencilscan/display/dummy_screen.h"
#include "pencilscan/display/projector_windows.h"
#include "pencilscan/display/screen_faults.h"
#include "pencilscan/display/shown_watch.h"
#include "pencilscan/display/x_screen.h"

namespace pencilscan {
namespace {

[[noreturn]] void fail() {
  throw StageError(
      "this pencilscan was built without screens: it needs SDL2 and the X libraries "
      "(script/bootstrap --lab, then script/build)");
}

}  // namespace

bool can_display() { return false; }

struct XScreen::State {};
XScreen::XScreen(const std::string&) { fail(); }
XScreen::~XScreen() = default;
std::vector<DisplayOutput> XScreen::outputs() const { fail(); }
cv::Mat XScreen::read(const DisplayOutput&) const { fail(); }
std::vector<std::string> XScreen::windows_over(const DisplayOutput&, const std::string&) const {
  fail();
}
void XScreen::paint_desktop_black() { fail(); }
bool XScreen::alters_colors(const DisplayOutput&) const { fail(); }

struct PlainOutputs::Before {};
PlainOutputs::PlainOutputs(XScreen&, std::span<const DisplayOutput>) { fail(); }
PlainOutputs::~PlainOutputs() = default;

struct ForeignWindow::State {};
ForeignWindow::ForeignWindow(const XScreen&, const DisplayOutput&, const cv::Rect&,
                             const std::string&) {
  fail();
}
ForeignWindow::~ForeignWindow() = default;

struct NightLight::State {};
NightLight::NightLight(const XScreen&, const DisplayOutput&) { fail(); }
NightLight::~NightLight() = default;

int free_display_number(const std::filesystem::path&) { fail(); }
struct DummyScreen::State {};
DummyScreen::DummyScreen(const std::filesystem::path&, const std::vector<Output>&) { fail(); }
DummyScreen::~DummyScreen() = default;
const std::string& DummyScreen::display() const { fail(); }
void DummyScreen::enter() const { fail(); }

struct ShownWatch::State {};
ShownWatch::ShownWatch(const std::string&, std::vector<std::string>, Sink) { fail(); }
ShownWatch::~ShownWatch() = default;
void ShownWatch::settle() { fail(); }

struct ProjectorWindows::State {};
ProjectorWindows::ProjectorWindows(const std::vector<OutputUse>&, const std::string&) { fail(); }
ProjectorWindows::~ProjectorWindows() = default;
std::size_t ProjectorWindows::size() const { fail(); }
std::int64_t ProjectorWindows::show(std::size_t, const cv::Mat&) { fail(); }
cv::Mat ProjectorWindows::read_back(std::size_t) { fail(); }
std::vector<Fault> ProjectorWindows::check() { fail(); }
bool ProjectorWindows::dismissed() const { fail(); }

}  // namespace pencilscan
