#include "pencilscan/joint/room_readings.h"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace pencilscan {
namespace {

/// Lines that a group may show instead of its own.
struct Reading {
  PatternRef pattern;
  int apart = 0;  ///< of each piece's line from the one that it has

  friend bool operator==(const Reading&, const Reading&) = default;
  friend bool operator<(const Reading& a, const Reading& b) {
    return PatternLine{a.pattern, a.apart} < PatternLine{b.pattern, b.apart};
  }
};

struct ReadingCost {
  float more = 0;             ///< than the group's own
  int pieces = 0;             ///< that can show it
  bool is_of_object = false;  ///< one of them, in the object's space
};

/// The readings of one camera's groups.
class RoomReadings {
 public:
  RoomReadings(const Camera& camera, const LabelledPieces& pieces,
               const std::vector<std::vector<float>>& known, const ObjectSpace& space,
               const JointOptions& options, std::vector<Decision>& decisions)
      : world_from_camera_(camera.device_from_world.inverse()),
        pieces_(pieces),
        known_(known),
        space_(space),
        wrong_color_(static_cast<float>(options.max_color_cost)),
        decisions_(decisions) {}

  /// True where a name of the group puts one of its pieces into the object's space.
  [[nodiscard]] bool is_of_object(const std::vector<int>& group) const {
    return std::any_of(group.begin(), group.end(),
                       [&](int p) { return holds(p, label(p, own(p))); });
  }

  /// Gives a group its reading in the room, or what its own is worth.
  void decide(const std::vector<int>& group) {
    const std::map<Reading, ReadingCost> readings = readings_of(group);
    float margin = std::numeric_limits<float>::max();
    float least = 0.5F * wrong_color_;
    const Reading* of_room = nullptr;
    for (const auto& [reading, cost] : readings) {
      margin = std::min(margin, cost.more);
      if (cost.is_of_object || cost.more >= least) continue;
      least = cost.more;
      of_room = &reading;
    }
    for (const int p : group) {
      Decision& decision = decisions_[index(p)];
      const std::size_t other = of_room == nullptr ? own(p) : find(p, *of_room);
      if (other != own(p) && other < pieces_.labels[index(p)].size()) {
        decision.label = static_cast<int>(other);
      } else {
        decision.margin = std::min(decision.margin, std::max(0.F, margin));
      }
    }
  }

 private:
  static std::size_t index(int p) { return static_cast<std::size_t>(p); }
  [[nodiscard]] std::size_t own(int p) const {
    return static_cast<std::size_t>(decisions_[index(p)].label);
  }
  [[nodiscard]] const PieceLabel& label(int p, std::size_t k) const {
    return pieces_.labels[index(p)][k];
  }
  [[nodiscard]] float cost(int p, std::size_t k) const {
    return label(p, k).cost + known_[index(p)][k];
  }
  [[nodiscard]] bool holds(int p, const PieceLabel& label) const {
    return space_.holds(world_from_camera_ * label.place(pieces_.graph.pieces[index(p)].middle));
  }
  /// The label of a piece that shows a reading; the number of its labels if none does.
  [[nodiscard]] std::size_t find(int p, const Reading& reading) const {
    const PatternLine line{reading.pattern, label(p, own(p)).line + reading.apart};
    const auto& labels = pieces_.labels[index(p)];
    const auto found = std::find_if(labels.begin(), labels.end(),
                                    [&](const PieceLabel& l) { return l.of() == line; });
    return static_cast<std::size_t>(found - labels.begin());
  }

  [[nodiscard]] std::map<Reading, ReadingCost> readings_of(const std::vector<int>& group) const {
    std::map<Reading, ReadingCost> readings;
    for (const int p : group) {
      for (std::size_t k = 0; k < pieces_.labels[index(p)].size(); ++k) {
        if (k == own(p)) continue;
        const PieceLabel& other = label(p, k);
        ReadingCost& of = readings[{other.pattern, other.line - label(p, own(p)).line}];
        of.more += cost(p, k) - cost(p, own(p));
        ++of.pieces;
        of.is_of_object = of.is_of_object || holds(p, other);
      }
    }
    for (auto& [reading, of] : readings)
      of.more += wrong_color_ * static_cast<float>(static_cast<int>(group.size()) - of.pieces);
    return readings;
  }

  RigidTransform world_from_camera_;
  const LabelledPieces& pieces_;
  const std::vector<std::vector<float>>& known_;
  const ObjectSpace& space_;
  float wrong_color_;
  std::vector<Decision>& decisions_;
};

}  // namespace

void give_to_room(const Camera& camera, const LabelledPieces& pieces, const Anchors& anchors,
                  const std::vector<std::vector<float>>& known, const ObjectSpace& space,
                  const JointOptions& options, std::vector<Decision>& decisions) {
  RoomReadings readings(camera, pieces, known, space, options, decisions);
  std::vector<char> is_seen = anchors.is_held;
  for (std::size_t first = 0; first < decisions.size(); ++first) {
    if (is_seen[first] != 0 || decisions[first].label < 0) continue;
    is_seen[first] = 1;
    std::vector<int> group{static_cast<int>(first)};
    for (std::size_t k = 0; k < group.size(); ++k) {
      for (const int q : anchors.linked[static_cast<std::size_t>(group[k])]) {
        if (std::exchange(is_seen[static_cast<std::size_t>(q)], 1) == 0) group.push_back(q);
      }
    }
    if (readings.is_of_object(group)) readings.decide(group);
  }
}

}  // namespace pencilscan
