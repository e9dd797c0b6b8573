#include "pencilscan/pipeline/found_floor.h"

#include <gtest/gtest.h>

#include <vector>

#include "pencilscan/core/random.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/rig/object_space.h"

namespace pencilscan {
namespace {

constexpr double kHeightOfFloor = -70;  // mm

/// PlacesAround on surfaces around the origin, off them by a tenth of a millimetre.
class PlacesAround {
 public:
  explicit PlacesAround(std::uint64_t seed) : random_(seed) {}

  /// Of a square disc at a height.
  void add_square(double height, double half, int count) {
    for (int i = 0; i < count; ++i)
      add({random_.uniform(-half, half), random_.uniform(-half, half), height});
  }
  void add_ball(double radius, int count) {
    for (int i = 0; i < count; ++i)
      add(radius * Vec3(random_.normal(), random_.normal(), random_.normal()).normalized());
  }
  void add_side(double half, int count) {
    for (int i = 0; i < count; ++i)
      add({half, random_.uniform(-half, half), random_.uniform(-half, half)});
  }

  [[nodiscard]] const std::vector<NamedPlace>& all() const { return places_; }

 private:
  void add(const Vec3& x) {
    constexpr double kNoise = 0.1;  // mm
    places_.push_back({x + kNoise * Vec3(random_.normal(), random_.normal(), random_.normal()), 1});
  }

  Random random_;
  std::vector<NamedPlace> places_;
};

Rig rig_above() {
  Rig rig = make_ring(sample::small_ring());
  rig.volume = Sphere{Vec3::Zero(), 100};
  return rig;
}

TEST(FoundFloor, IsWhatABallStandsOn) {
  PlacesAround places(1);
  places.add_square(kHeightOfFloor, 250, 3000);
  places.add_ball(-kHeightOfFloor, 2000);
  const auto found = find_floor(rig_above(), places.all());
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->floor.point.z(), kHeightOfFloor, 0.05);
  EXPECT_GT(found->floor.normal.z(), 0.9999);
  EXPECT_GT(found->sides, 0.9);
  EXPECT_GT(found->share, 0.5);  // places outside of the volume count, most of those on it
}

TEST(FoundFloor, IsNoneThatTheRigStates) {
  PlacesAround places(1);
  places.add_square(kHeightOfFloor, 250, 3000);
  places.add_ball(-kHeightOfFloor, 2000);
  Rig rig = rig_above();
  rig.floor = Floor{{0, 0, kHeightOfFloor}, Vec3::UnitZ()};
  EXPECT_FALSE(find_floor(rig, places.all()));
}

TEST(FoundFloor, IsNoPlateWithoutAnObject) {
  PlacesAround places(2);
  places.add_square(kHeightOfFloor, 250, 3000);
  EXPECT_FALSE(find_floor(rig_above(), places.all()));
}

TEST(FoundFloor, IsNoBall) {
  PlacesAround places(3);
  places.add_ball(80, 3000);
  EXPECT_FALSE(find_floor(rig_above(), places.all()));
}

TEST(FoundFloor, IsNoFaceOfABox) {
  PlacesAround places(4);
  places.add_square(50, 50, 3000);
  places.add_side(50, 3000);
  EXPECT_FALSE(find_floor(rig_above(), places.all()));
}

TEST(FoundFloor, IsNothingThatCamerasSeeThrough) {
  PlacesAround places(5);
  places.add_square(0, 250, 3000);
  places.add_ball(80, 2000);
  EXPECT_FALSE(find_floor(rig_above(), places.all()));
}

}  // namespace
}  // namespace pencilscan
