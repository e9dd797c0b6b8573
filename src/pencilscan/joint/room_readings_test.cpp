#include "pencilscan/joint/room_readings.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "pencilscan/rig/sample_devices.h"

namespace pencilscan {
namespace {

constexpr int kPeriod = 8;
constexpr float kMargin = 8;

/// Four lines side by side, a curve of one piece each. Each is named in the volume, and a period
/// away in the room.
struct LinesBeforeRoom {
  LinesBeforeRoom() {
    const Camera& camera = rig.camera(0);
    const auto distance =
        static_cast<float>((camera.device_from_world * working_volume(rig).center).z());
    for (int c = 0; c < 4; ++c) {
      CurvePiece piece;
      piece.curve = c;
      pieces.graph.pieces.push_back(piece);
      std::vector<PieceLabel> labels(2);
      for (int k = 0; k < 2; ++k) {
        PieceLabel& label = labels[static_cast<std::size_t>(k)];
        label.pattern = {0, 0};
        label.line = 20 + c - k * kPeriod;
        label.q = {0, 0, 1 / (distance * static_cast<float>(1 + k))};
      }
      pieces.labels.push_back(labels);
      known.emplace_back(2, 0.F);
    }
    decisions.assign(4, Decision{0, kMargin});
    anchors.linked = {{1}, {0, 2}, {1, 3}, {2}};
    anchors.neighbors.assign(4, 0);
    anchors.is_held.assign(4, 0);
  }

  [[nodiscard]] std::vector<Decision> decided() const {
    std::vector<Decision> result = decisions;
    give_to_room(rig.camera(0), pieces, anchors, known, ObjectSpace(rig), {}, result);
    return result;
  }
  [[nodiscard]] std::vector<int> labels() const {
    std::vector<int> result;
    for (const Decision& decision : decided()) result.push_back(decision.label);
    return result;
  }

  Rig rig = sample::small_rig(240, 200, 110);
  LabelledPieces pieces;
  std::vector<std::vector<float>> known;
  std::vector<Decision> decisions;
  Anchors anchors;
};

TEST(RoomReadings, LinesThatNothingHoldsAreTheRooms) {
  LinesBeforeRoom lines;
  EXPECT_EQ(lines.labels(), std::vector<int>({1, 1, 1, 1}));
  for (const Decision& decision : lines.decided()) EXPECT_EQ(decision.margin, kMargin);
  // A piece that cannot lie in the room costs too much.
  lines.pieces.labels[2].pop_back();
  lines.known[2].pop_back();
  EXPECT_EQ(lines.labels(), std::vector<int>({0, 0, 0, 0}));
  // It does not where others prefer the room. It is no longer sure then.
  lines.known[0][1] = -3;
  EXPECT_EQ(lines.labels(), std::vector<int>({1, 1, 0, 1}));
  EXPECT_EQ(lines.decided()[2].margin, 1);
}

TEST(RoomReadings, LinesThatCrossingsHoldAreNot) {
  LinesBeforeRoom lines;
  lines.anchors.is_held.assign(4, 1);
  EXPECT_EQ(lines.labels(), std::vector<int>({0, 0, 0, 0}));
  EXPECT_EQ(lines.decided()[1].margin, kMargin);
}

TEST(RoomReadings, AreAsSureAsOthersSay) {
  LinesBeforeRoom lines;
  lines.known[1][0] = -3;
  for (const Decision& decision : lines.decided()) {
    EXPECT_EQ(decision.label, 0);
    EXPECT_EQ(decision.margin, 3);
  }
  for (auto& of_piece : lines.known) of_piece[0] = -3;
  EXPECT_EQ(lines.decided()[1].margin, kMargin);
}

TEST(RoomReadings, OfTheRoomAloneStay) {
  LinesBeforeRoom lines;
  for (auto& labels : lines.pieces.labels) labels[0].q *= 0.25F;
  EXPECT_EQ(lines.labels(), std::vector<int>({0, 0, 0, 0}));
  EXPECT_EQ(lines.decided()[1].margin, kMargin);
}

}  // namespace
}  // namespace pencilscan
