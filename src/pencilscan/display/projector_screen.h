#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/core/fault.h"
#include "pencilscan/display/projector_picture.h"

namespace pencilscan {

/// All projectors of a rig, wherever their pictures go.
class ProjectorScreen {
 public:
  ProjectorScreen() = default;
  virtual ~ProjectorScreen() = default;
  ProjectorScreen(const ProjectorScreen&) = delete;
  ProjectorScreen& operator=(const ProjectorScreen&) = delete;

  /// In the order of the rig.
  [[nodiscard]] virtual const std::vector<Projector>& projectors() const = 0;
  /// Shows a picture; the time (host_now_ns()) when it was handed on.
  virtual std::int64_t show(std::size_t projector, const ProjectorPicture& picture) = 0;
  /// How what is shown differs from what should be.
  [[nodiscard]] virtual std::vector<Fault> check() = 0;
  /// 0: unknown.
  [[nodiscard]] virtual double refresh_hz(std::size_t projector) const = 0;
  static constexpr double kUsualRefreshHz = 60;  ///< where it is unknown

  void show_all(const ProjectorPicture& picture) {
    for (std::size_t p = 0; p < projectors().size(); ++p) show(p, picture);
  }
};

/// On the outputs of this computer: `projectors` with their outputs stated (uses_of()). InputError
/// and StageError as of ProjectorWindows.
[[nodiscard]] std::unique_ptr<ProjectorScreen> open_screen(std::vector<Projector> projectors);

}  // namespace pencilscan
