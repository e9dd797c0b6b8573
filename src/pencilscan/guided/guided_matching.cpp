#include "pencilscan/guided/guided_matching.h"

#include <optional>
#include <utility>

#include "pencilscan/core/parallel.h"
#include "pencilscan/guided/adopted_curves.h"
#include "pencilscan/guided/camera_names.h"
#include "pencilscan/guided/denied_lines.h"
#include "pencilscan/guided/found_lines.h"

namespace pencilscan {

std::vector<LocalSurface> match_guided(const Rig& rig, const std::vector<ColorFamily>& families,
                                       std::vector<std::vector<cv::Mat>> presence,
                                       std::span<GridGraph> graphs, Labeling& labeling,
                                       const GuidedMatchingOptions& options,
                                       std::span<const MeasuredPoint> dense) {
  std::vector<std::optional<LocalSurface>> surfaces(graphs.size());
  labeling.denied.assign(labeling.runs.size(), {});
  labeling.undecided.resize(labeling.runs.size());
  labeling.expected.assign(labeling.runs.size(), {});
  parallel_for(graphs.size(), [&](std::size_t g) {
    const auto camera = static_cast<std::size_t>(graphs[g].camera);
    CameraNames names(rig, families, graphs[g], labeling.runs[camera], options, dense);
    LineSearch search(rig, families, std::move(presence[g]), options, names);
    CurveAdoption adoption(rig, families, options, names);
    for (int pass = 0; pass < options.passes; ++pass) {
      names.predict();
      adoption.confirm(labeling.tentative[camera]);
      adoption.adopt();
      search.find_missing();
      if (!dense.empty()) {
        search.find_merged();
        search.name_shared();
      }
    }
    const std::vector<DeniedRun>& denied = adoption.denied();
    if (!denied.empty())
      drop_beside_denied(graphs[g], denied, labeling.runs[camera], labeling.undecided[camera]);
    labeling.denied[camera] = denied;
    labeling.expected[camera] = names.expected();
    surfaces[g] = names.take_surface();
  });
  std::vector<LocalSurface> result;
  for (auto& surface : surfaces) result.push_back(*std::move(surface));
  return result;
}

}  // namespace pencilscan
