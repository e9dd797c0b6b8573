#include "pencilscan/pipeline/naming_doubt.h"

#include <algorithm>

#include "pencilscan/core/formatted.h"
#include "pencilscan/core/median.h"
#include "pencilscan/core/name_list.h"

namespace pencilscan {
namespace {

/// The projectors that show patterns in the colours of a family.
std::vector<std::size_t> projectors_of(const ColorFamily& family) {
  std::vector<std::size_t> projectors;
  for (const PatternRef& ref : family.patterns)
    projectors.push_back(static_cast<std::size_t>(ref.projector));
  std::sort(projectors.begin(), projectors.end());
  projectors.erase(std::unique(projectors.begin(), projectors.end()), projectors.end());
  return projectors;
}

/// Points of a camera's curves of one family that a right rig could have named, and has not.
std::size_t unnamed_points(const GridGraph& graph, const Labeling& labeling, std::size_t family) {
  const auto c = static_cast<std::size_t>(graph.camera);
  std::vector<UndecidedRun> runs;
  for (const UndecidedRun& run : labeling.undecided[c]) {
    const Curve& curve = graph.curves[static_cast<std::size_t>(run.curve)];
    if (curve.family == static_cast<int>(family)) runs.push_back(run);
  }
  const auto points = undecided_points(runs, labeling.runs[c]);
  return points[static_cast<std::size_t>(UndecidedReason::kAmbiguous)] +
         points[static_cast<std::size_t>(UndecidedReason::kContradicted)];
}

}  // namespace

NamingDoubt::NamingDoubt(const Rig& rig)
    : rig_(&rig), devices_(device_count(rig)), sharing_(device_count(rig), 1), colors_(rig) {
  for (const ColorFamily& family : color_families(rig)) {
    const std::vector<std::size_t> projectors = projectors_of(family);
    for (const std::size_t p : projectors) {
      std::size_t& sharing = sharing_[rig.cameras.size() + p];
      sharing = std::max(sharing, projectors.size());
    }
  }
}

void NamingDoubt::add(const std::vector<ColorFamily>& families, std::span<const GridGraph> graphs,
                      const Labeling& labeling) {
  colors_.add(families, graphs, labeling);
  for (const GridGraph& graph : graphs) {
    const auto c = static_cast<std::size_t>(graph.camera);
    devices_[c].add(telling_points(labeling, c));
    for (const LabeledRun& run : labeling.runs[c]) {
      const auto p = static_cast<std::size_t>(run.label.pattern.projector);
      devices_[rig_->cameras.size() + p].named += static_cast<std::size_t>(run.end - run.begin);
    }
    for (std::size_t f = 0; f < families.size(); ++f) {
      const std::size_t unnamed = unnamed_points(graph, labeling, f);
      for (const std::size_t p : projectors_of(families[f]))
        devices_[rig_->cameras.size() + p].unnamed += unnamed;
    }
  }
}

bool NamingDoubt::shows_lines(std::size_t projector) const {
  // Of a projector that is off, what is drawn in its colours is what is left of others that share
  // them: .11 of what the others have named (six cameras, six projectors). Of one that was turned
  // by 3 degrees it is 1.06. The root of their product.
  constexpr double kShown = 0.34;
  const std::size_t first = rig_->cameras.size();
  std::vector<std::size_t> named;
  for (std::size_t d = first; d < devices_.size(); ++d)
    if (d != first + projector) named.push_back(devices_[d].named);
  const auto usual = static_cast<double>(upper_median(std::move(named)));
  return static_cast<double>(devices_[first + projector].all()) >= kShown * usual;
}

bool NamingDoubt::lacks_names(std::size_t device) const {
  const TellingPoints& points = devices_[device];
  const double most = kMostNamed / static_cast<double>(sharing_[device]);
  if (!points.are_enough() || points.named_share() > most) return false;
  return device < rig_->cameras.size() || shows_lines(device - rig_->cameras.size());
}

std::string NamingDoubt::unnamed(std::size_t device) const {
  if (!lacks_names(device)) return {};
  return "only " + formatted(100 * devices_[device].named_share(), "%.0f") + " % of the curves " +
         (device < rig_->cameras.size() ? "of camera " : "in the colours of projector ") +
         device_at(*rig_, device).name + " have a name";
}

std::vector<std::size_t> NamingDoubt::cameras() const {
  const std::vector<ShownColors> seen = colors_.seen();
  std::vector<std::size_t> cameras;
  for (std::size_t c = 0; c < rig_->cameras.size(); ++c)
    if (lacks_names(c) || seen[c].deny()) cameras.push_back(c);
  return cameras;
}

std::string NamingDoubt::of_projectors() const {
  std::string text;
  for (std::size_t d = rig_->cameras.size(); d < devices_.size(); ++d) {
    const std::string lack = unnamed(d);
    if (!lack.empty()) add_name(text, lack, "; ");
  }
  const std::string projectors = denied();
  if (!projectors.empty())
    add_name(text, "the colours of " + projectors + " are those of other lines than the ones named",
             "; ");
  return text;
}

std::string NamingDoubt::text() const {
  std::string text;
  for (std::size_t c = 0; c < rig_->cameras.size(); ++c) {
    const std::string lack = unnamed(c);
    if (!lack.empty()) add_name(text, lack, "; ");
  }
  const std::string projectors = of_projectors();
  if (!projectors.empty()) add_name(text, projectors, "; ");
  return text;
}

NamingDoubt naming_doubt(const Rig& rig, std::span<const FrameCurves> frames,
                         std::span<const Labeling> labelings) {
  NamingDoubt doubt(rig);
  for (std::size_t f = 0; f < frames.size(); ++f)
    doubt.add(frames[f].families, frames[f].graphs, labelings[f]);
  return doubt;
}

}  // namespace pencilscan
