#pragma once

#include <span>
#include <string>
#include <vector>

#include "pencilscan/pipeline/line_naming.h"
#include "pencilscan/pipeline/rig_refinement.h"
#include "pencilscan/refinement/shown_colors.h"

namespace pencilscan {

/// What names of lines say against a rig, where crossings say nothing: a device that stands far
/// from where the rig has it has few names, or names that are whole lines off, and what crossings
/// there are may meet.
class NamingDoubt {
 public:
  /// The rig must outlive it.
  explicit NamingDoubt(const Rig& rig);
  /// One frame.
  void add(const std::vector<ColorFamily>& families, std::span<const GridGraph> graphs,
           const Labeling& labeling);

  /// Projectors, and cameras, whose lines have the colours of others than the ones named; empty:
  /// none.
  [[nodiscard]] std::string denied() const { return colors_.denied(); }
  /// Projectors whose lines are of several colours and all look alike; empty: none.
  [[nodiscard]] std::string alike() const { return colors_.alike(); }
  /// What the colours say, by pattern.
  [[nodiscard]] std::vector<ShownColors> shown_colors() const { return colors_.shown(); }
  /// In plain words, projectors most of what is drawn in whose colours has no name, and devices
  /// that colours deny; empty: none. One that shows nothing is not among them.
  [[nodiscard]] std::string of_projectors() const;
  /// The same, and cameras most of whose curves have no name.
  [[nodiscard]] std::string text() const;
  /// Cameras most of whose curves have no name, or that colours deny.
  [[nodiscard]] std::vector<std::size_t> cameras() const;
  /// Whether most curves of a camera, or most of what is drawn in a projector's colours, have no
  /// name: of what may be of several projectors, a share as large. False for one that shows
  /// nothing.
  [[nodiscard]] bool lacks_names(std::size_t device) const;
  /// Of a camera, or in the colours of a projector.
  [[nodiscard]] const TellingPoints& telling(std::size_t device) const { return devices_[device]; }

 private:
  /// False where hardly anything is drawn in a projector's colours that may be its own: it shows
  /// nothing, wherever it stands.
  [[nodiscard]] bool shows_lines(std::size_t projector) const;
  [[nodiscard]] std::string unnamed(std::size_t device) const;

  const Rig* rig_;
  std::vector<TellingPoints> devices_;  ///< cameras, then projectors: in the colours of each
  /// How many may have drawn what has no name: those with a projector's colours; of cameras, one.
  std::vector<std::size_t> sharing_;
  ShownColorCount colors_;
};

/// What the names of several frames say, a labeling per frame. The rig must outlive it.
[[nodiscard]] NamingDoubt naming_doubt(const Rig& rig, std::span<const FrameCurves> frames,
                                       std::span<const Labeling> labelings);

}  // namespace pencilscan
