#include "pencilscan/joint/other_views.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pencilscan/core/parallel.h"

namespace pencilscan {
OtherViews::OtherViews(const Rig& rig, std::span<const GridGraph> graphs,
                       std::span<const LabelledPieces> pieces)
    : rig_(rig), graphs_(graphs), pieces_(pieces), sightings_(graphs.size()) {
  for (std::size_t g = 0; g < graphs.size(); ++g) voices_.push_back(voices_of(g));
  std::vector<View> views(graphs.size());
  parallel_for(graphs.size(), [&](std::size_t g) { views[g] = make_view(g); });
  parallel_for(graphs.size(), [&](std::size_t g) { sightings_[g] = look_from_others(g, views); });
}

OtherViews::View OtherViews::make_view(std::size_t g) const {
  const Camera& camera = rig_.camera(graphs_[g].camera);
  int families = 0;
  for (const Curve& curve : graphs_[g].curves) families = std::max(families, curve.family + 1);
  std::vector<std::vector<Entry>> entries(static_cast<std::size_t>(families));
  const auto& list = pieces_[g].graph.pieces;
  for (std::size_t p = 0; p < list.size(); ++p) {
    const Curve& curve = graphs_[g].curves[static_cast<std::size_t>(list[p].curve)];
    for (int i = list[p].begin; i < list[p].end; ++i) {
      const CurvePoint& point = curve.points[static_cast<std::size_t>(i)];
      entries[static_cast<std::size_t>(curve.family)].push_back(
          {point.position, point.tangent(), static_cast<int>(p)});
    }
  }
  View view;
  for (const auto& of_family : entries) {
    CellIndex index({camera.width, camera.height}, kCellPx, of_family.size(), [&](std::size_t i) {
      return std::pair(of_family[i].position.x(), of_family[i].position.y());
    });
    std::vector<Entry> ordered;
    ordered.reserve(of_family.size());
    for (const int i : index.items()) ordered.push_back(of_family[static_cast<std::size_t>(i)]);
    view.push_back({std::move(index), std::move(ordered)});
  }
  return view;
}

int OtherViews::find(const FamilyView& view, const Eigen::Vector2f& position,
                     const Eigen::Vector2f& tangent) {
  // What the place may be off by errors of rig and depth is chosen, no fit of it is kept.
  constexpr float kMaxAcross = 1.8F;  // px
  constexpr float kMaxAlong = 1;      // px: points of a curve lie so far apart
  constexpr float kMinCosine = 0.9F;  // 26 degrees
  float best = kMaxAcross;
  int piece = -1;
  const float reach = std::sqrt(kMaxAcross * kMaxAcross + kMaxAlong * kMaxAlong);
  view.index.ranges(position.x(), position.y(), reach, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Entry& e = view.entries[i];
      const Eigen::Vector2f way = position - e.position;
      if (std::abs(way.dot(e.tangent)) > kMaxAlong) continue;
      const float across = std::abs(way.x() * e.tangent.y() - way.y() * e.tangent.x());
      if (across >= best || std::abs(e.tangent.dot(tangent)) < kMinCosine) continue;
      best = across;
      piece = e.piece;
    }
    return true;
  });
  return piece;
}

OtherViews::Voices OtherViews::voices_of(std::size_t g) const {
  constexpr double kFar = -0.25;  // cosine of the angle between the axes: 105 degrees
  const auto graphs_of = [&](const std::vector<int>& cameras) {
    std::vector<std::size_t> result;
    for (const int c : cameras) {
      for (std::size_t k = 0; k < graphs_.size(); ++k) {
        // Without a picture, or left out, it saw no line of any name.
        if (graphs_[k].camera == c && !graphs_[k].curves.empty()) result.push_back(k);
      }
    }
    return result;
  };
  std::vector<std::size_t> near = graphs_of(adjacent_cameras(rig_, graphs_[g].camera));
  if (!near.empty()) return {std::move(near), 0.7F};  // see below: .67 at 60 degrees
  // Cameras far apart see less of the same surface: whole patches turn away from one of them, or
  // are hidden from it. Measured: of the surest labels, another camera sees .67 from 60 degrees
  // apart and .43 from 90 degrees (bunny and hand before six and six, bunny before four and four).
  // Tried here: .25, .3, .35 and .43. With .35 the fewest names were wrong, of six objects before
  // four and four.
  std::vector<std::size_t> far = graphs_of(adjacent_cameras(rig_, graphs_[g].camera, kFar));
  // A single camera has no say: if the two contradict each other, both lose their names, and nobody
  // knows which one moved.
  if (far.size() < 2) return {};
  return {std::move(far), 0.35F};
}

std::vector<OtherViews::Sighting> OtherViews::look_from_others(std::size_t g,
                                                               std::span<const View> views) const {
  const Camera& camera = rig_.camera(graphs_[g].camera);
  const RigidTransform world_from_camera = camera.device_from_world.inverse();
  constexpr float kPixels = 3;  // along the piece, to see its direction there
  const float ahead = kPixels / static_cast<float>(camera.focal_px());
  std::vector<Sighting> sightings;
  for (std::size_t p = 0; p < pieces_[g].labels.size(); ++p) {
    const CurvePiece& piece = pieces_[g].graph.pieces[p];
    const int family = graphs_[g].curves[static_cast<std::size_t>(piece.curve)].family;
    for (std::size_t k = 0; k < pieces_[g].labels[p].size(); ++k) {
      const PieceLabel& label = pieces_[g].labels[p][k];
      const Vec3 here = world_from_camera * label.place(piece.middle);
      const Vec3 next = world_from_camera * label.place(piece.middle + ahead * piece.tangent);
      for (const std::size_t o : voices_[g].graphs) {
        const Camera& other = rig_.camera(graphs_[o].camera);
        const auto a = other.project(here);
        if (!a || !other.contains(*a)) continue;
        const auto b = other.project(next);
        if (!b) continue;
        const Eigen::Vector2f tangent = (*b - *a).cast<float>().normalized();
        Sighting sighting{static_cast<int>(p), static_cast<int>(k), static_cast<int>(o), -1, -1};
        if (static_cast<std::size_t>(family) < views[o].size()) {
          sighting.hit =
              find(views[o][static_cast<std::size_t>(family)], a->cast<float>(), tangent);
        }
        if (sighting.hit >= 0) {
          const auto& their = pieces_[o].labels[static_cast<std::size_t>(sighting.hit)];
          for (std::size_t j = 0; j < their.size(); ++j) {
            if (their[j].pattern == label.pattern && their[j].line == label.line)
              sighting.same = static_cast<int>(j);
          }
        }
        sightings.push_back(sighting);
      }
    }
  }
  return sightings;
}

void OtherViews::forget(std::span<const std::vector<std::vector<int>>> new_index) {
  for (std::size_t g = 0; g < sightings_.size(); ++g) {
    for (Sighting& s : sightings_[g]) {
      s.label = new_index[g][static_cast<std::size_t>(s.piece)][static_cast<std::size_t>(s.label)];
      if (s.same >= 0)
        s.same = new_index[static_cast<std::size_t>(s.graph)][static_cast<std::size_t>(s.hit)]
                          [static_cast<std::size_t>(s.same)];
    }
    std::erase_if(sightings_[g], [](const Sighting& s) { return s.label < 0; });
  }
}

std::vector<std::vector<float>> OtherViews::costs(std::size_t g,
                                                  std::span<const PieceBeliefs> beliefs) const {
  // Three probabilities. All are chosen, no fit of them is kept.
  constexpr float kHitByChance = 0.2F;    // the other camera sees a curve where a wrong label lies
  constexpr float kSameIfTrue = 0.85F;    // a curve that it sees has the label, which is true
  constexpr float kSameByChance = 0.03F;  // ... which is wrong
  const float hit_if_true = voices_[g].hit_if_true;
  const float miss = -std::log((1 - hit_if_true) / (1 - kHitByChance));
  const float unknown_hit = -std::log(hit_if_true / kHitByChance);
  std::vector<std::vector<float>> result;
  for (const auto& labels : pieces_[g].labels) result.emplace_back(labels.size(), 0.F);
  for (const Sighting& s : sightings_[g]) {
    float& cost = result[static_cast<std::size_t>(s.piece)][static_cast<std::size_t>(s.label)];
    const PieceBeliefs& their = beliefs[static_cast<std::size_t>(s.graph)];
    if (s.hit < 0) {
      cost += miss;
    } else if (their.empty()) {
      cost += unknown_hit;
    } else {
      const float same =
          s.same < 0 ? 0.F
                     : their[static_cast<std::size_t>(s.hit)][static_cast<std::size_t>(s.same)];
      cost -= std::log(same * kSameIfTrue / kSameByChance +
                       (1 - same) * (1 - kSameIfTrue) / (1 - kSameByChance));
    }
  }
  return result;
}

}  // namespace pencilscan
