#include "pencilscan/joint/ghosts_before_room.h"

#include <vector>

#include "pencilscan/core/disjoint_sets.h"

namespace pencilscan {
namespace {

enum class Shown : char { kNothing, kObject, kRoom };

}  // namespace

void leave_ghosts_before_room(const Camera& camera, const LabelledPieces& pieces,
                              const ObjectSpace& space, const JointOptions& options,
                              std::span<Decision> decisions) {
  const RigidTransform world_from_camera = camera.device_from_world.inverse();
  const auto label_of = [&](std::size_t p) -> const PieceLabel& {
    return pieces.labels[p][static_cast<std::size_t>(decisions[p].label)];
  };
  std::vector<Shown> shown(decisions.size(), Shown::kNothing);
  bool is_room_named = false;
  for (std::size_t p = 0; p < shown.size(); ++p) {
    if (decisions[p].label < 0) continue;
    const Vec3 place = world_from_camera * label_of(p).place(pieces.graph.pieces[p].middle);
    shown[p] = space.holds(place) ? Shown::kObject : Shown::kRoom;
    is_room_named = is_room_named || shown[p] == Shown::kRoom;
  }
  if (!is_room_named) return;
  DisjointSets patches(shown.size());
  std::vector<int> ends(shown.size(), 2);   // of its curve, per piece
  std::vector<int> meets(shown.size(), 0);  // lines of the room, likewise
  const auto note = [&](std::size_t a, std::size_t b, bool is_same_surface) {
    if (shown[a] == Shown::kNothing || shown[b] == Shown::kNothing) return;
    if (shown[a] == shown[b]) {
      if (is_same_surface && shown[a] == Shown::kObject)
        patches.join(static_cast<int>(a), static_cast<int>(b));
    } else if (!is_same_surface) {
      ++meets[shown[a] == Shown::kObject ? a : b];
    }
  };
  const CrossingCost cost(pieces, options);
  for (const PieceCrossing& x : pieces.graph.crossings) {
    const auto a = static_cast<std::size_t>(x.a);
    const auto b = static_cast<std::size_t>(x.b);
    const bool are_named = decisions[a].label >= 0 && decisions[b].label >= 0;
    note(a, b, are_named && cost(label_of(a), label_of(b), x) < options.disagreement_cost());
  }
  for (const auto& [first, second] : pieces.graph.continuations) {
    const auto a = static_cast<std::size_t>(first);
    const auto b = static_cast<std::size_t>(second);
    --ends[a];
    --ends[b];
    const bool are_named = decisions[a].label >= 0 && decisions[b].label >= 0;
    note(a, b, are_named && label_of(a).of() == label_of(b).of());
  }
  const auto patch_of = [&](std::size_t p) {
    return static_cast<std::size_t>(patches.root(static_cast<int>(p)));
  };
  std::vector<int> excess(shown.size(), 0);
  for (std::size_t p = 0; p < shown.size(); ++p)
    if (shown[p] == Shown::kObject) excess[patch_of(p)] += meets[p] - ends[p];
  for (std::size_t p = 0; p < shown.size(); ++p)
    if (shown[p] == Shown::kObject && excess[patch_of(p)] > 0) decisions[p] = {};
}

}  // namespace pencilscan
