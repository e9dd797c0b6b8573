#include "pencilscan/display/projector_screen.h"

#include "pencilscan/display/projector_windows.h"

namespace pencilscan {
namespace {

class WindowScreen final : public ProjectorScreen {
 public:
  explicit WindowScreen(std::vector<Projector> projectors) : projectors_(std::move(projectors)) {
    const auto outputs = XScreen().outputs();
    Rig rig;
    rig.projectors = projectors_;
    const auto uses = uses_of(rig, outputs, {}, "rig");
    for (const OutputUse& use : uses) refresh_hz_.push_back(use.output->refresh_hz);
    windows_ = std::make_unique<ProjectorWindows>(uses);
  }

  const std::vector<Projector>& projectors() const override { return projectors_; }
  double refresh_hz(std::size_t projector) const override { return refresh_hz_[projector]; }
  std::vector<Fault> check() override { return windows_->check(); }
  std::int64_t show(std::size_t projector, const ProjectorPicture& picture) override {
    return windows_->show(projector, render_picture(picture, projectors_[projector]));
  }

 private:
  std::vector<Projector> projectors_;
  std::vector<double> refresh_hz_;
  std::unique_ptr<ProjectorWindows> windows_;
};

}  // namespace

std::unique_ptr<ProjectorScreen> open_screen(std::vector<Projector> projectors) {
  return std::make_unique<WindowScreen>(std::move(projectors));
}

}  // namespace pencilscan
