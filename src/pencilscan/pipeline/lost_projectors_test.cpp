#include "pencilscan/pipeline/lost_projectors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pencilscan/core/median.h"
#include "pencilscan/evaluation/label_error.h"
#include "pencilscan/evaluation/truth_scene.h"
#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/joint/joint.h"
#include "pencilscan/pipeline/projector_places.h"
#include "pencilscan/pipeline/rig_periods.h"
#include "pencilscan/pipeline/sample_frame.h"
#include "pencilscan/planning/ring.h"
#include "pencilscan/points/triangulate.h"

namespace pencilscan {
namespace {

constexpr std::size_t kAcross = 1;   // shows horizontal lines, which most of the others' cross
constexpr std::size_t kUpright = 2;  // vertical ones, which few cross
constexpr double kPitchPx = 13;

RingOptions ring_of_four() {
  RingOptions options;
  options.cameras = options.projectors = 4;
  options.camera_width = 800;
  options.camera_height = 600;
  options.camera_focal_px = 1440;
  options.pitch_px = kPitchPx;
  options.line_width_px = 4.5;
  options.offset_px = 6.5;
  return options;
}
const double kMm = 1 / footprint(make_ring(ring_of_four()));  // in footprints

/// A ball with bumps as large as they are on a stone.
TriangleMesh stone() {
  TriangleMesh mesh = make_sphere(140, 64);
  for (Vec3& x : mesh.vertices) {
    x *= 1 + 0.06 * std::sin(x.x() / 23) * std::sin(x.y() / 29 + 1) * std::sin(x.z() / 31 + 2);
    x *= kMm;
  }
  return mesh;
}

FrameCurves curves_of(const Rig& rig, const TriangleMesh& mesh) {
  const PointResult seen =
      detect_frame(rig, sample::photographed_frame(rig, SimulatedObject(mesh), {}));
  return {seen.families, seen.graphs};
}

class LostProjectors : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = new Rig(in_footprints(make_ring(ring_of_four())));
    curves_ = new FrameCurves(curves_of(*rig_, stone()));
  }
  static void TearDownTestSuite() {
    delete curves_;
    delete rig_;
  }
  static Rig knocked(std::size_t p, const PoseCorrection& by) {
    Rig rig = *rig_;
    Projector& projector = rig.projectors[p];
    projector.device_from_world = corrected_pose(projector, by);
    return rig;
  }
  /// Root mean square over points of the volume, px across the lines.
  static double way(const Projector& a, const Projector& b) {
    const auto axis = static_cast<Eigen::Index>(a.patterns.front().axis);
    double sum = 0;
    const TriangleMesh mesh = stone();
    for (const Vec3& x : mesh.vertices)
      sum += std::pow((*a.project(0.8 * x))[axis] - (*b.project(0.8 * x))[axis], 2);
    return std::sqrt(sum / static_cast<double>(mesh.vertices.size()));
  }

  inline static Rig* rig_ = nullptr;
  inline static FrameCurves* curves_ = nullptr;
};

// A shift of 20 footprints is one of 21 px.
const PoseCorrection kByHalfPeriodAndRoll{Vec3(50, 15, 180), Vec3(-12, 9, 20)};
const PoseCorrection kByPeriod{Vec3(-20, 8 * kPitchPx, 0), Vec3(10, 0, -9)};

TEST_F(LostProjectors, PlacesThatTwoCamerasSeeAreOnTheSurfaceWhateverTheirLinesAreNamed) {
  Labeling right = solve_joint(*rig_, curves_->families, curves_->graphs, JointOptions{});
  Labeling others = right;
  Labeling shifted = right;
  for (std::size_t c = 0; c < rig_->cameras.size(); ++c) {
    const auto is_own = [](const LabeledRun& run) {
      return run.label.pattern.projector == static_cast<int>(kUpright);
    };
    std::erase_if(others.runs[c], is_own);
    for (LabeledRun& run : shifted.runs[c])
      if (is_own(run)) run.label.line += 1;
  }
  const auto crossings = places_of_projector(*rig_, {curves_, 1}, {&others, 1}, kUpright);
  const auto all = places_of_projector(*rig_, {curves_, 1}, {&right, 1}, kUpright);
  const auto all_shifted = places_of_projector(*rig_, {curves_, 1}, {&shifted, 1}, kUpright);
  ASSERT_GT(all.size(), crossings.size() + 150);
  ASSERT_EQ(all_shifted.size(), all.size());
  const RayScene surface(stone());
  std::size_t elsewhere = 0;
  std::vector<double> misses;  // in deviations
  for (std::size_t i = 0; i < all.size(); ++i) {
    elsewhere += (all[i].place.position - all_shifted[i].place.position).norm() > 1e-6 ? 1U : 0U;
    const auto& [position, family, layer, color] = all[i].place;
    misses.push_back(surface.closest_point(position)->distance / all[i].spread.norm());
  }
  std::sort(misses.begin(), misses.end());
  // A ray may meet a line twice; the place nearer to where the name has it is taken.
  EXPECT_LT(elsewhere, all.size() / 50);
  EXPECT_LT(misses[misses.size() / 2], 1);
  EXPECT_LT(misses[misses.size() * 95 / 100], 4);  // Of silhouettes, some are beside it.
}

TEST_F(LostProjectors, OnesInTheirPlacesStayAndAKnockedOneIsFound) {
  constexpr double kPx = 0.3;  // crossings are known to .2 px, and there are hundreds
  const auto in_place = find_projectors(*rig_, {curves_, 1});
  EXPECT_GE(in_place.size(), 2U);
  for (const FoundProjector& found : in_place) {
    EXPECT_FALSE(found.is_elsewhere()) << found.projector;
    EXPECT_LT(found.lines_away, 0.05) << found.projector;
    EXPECT_GT(found.share, 0.7) << found.projector;
  }
  const Rig rig = knocked(kAcross, kByHalfPeriodAndRoll);
  std::size_t elsewhere = 0;
  for (const FoundProjector& found : find_projectors(rig, {curves_, 1})) {
    elsewhere += found.is_elsewhere() ? 1U : 0U;
    if (found.projector != kAcross) continue;
    EXPECT_TRUE(found.is_elsewhere());
    EXPECT_FALSE(found.is_ambiguous);
    Projector put_back = rig.projectors[kAcross];
    put_back.device_from_world = corrected_pose(put_back, found.correction);
    EXPECT_LT(way(put_back, rig_->projectors[kAcross]), kPx);
  }
  EXPECT_EQ(elsewhere, 1U);
}

// Few lines cross these: only two cameras that see one line tell such names apart.
TEST_F(LostProjectors, ARefinedRigHasOneAPeriodOfTheCodeOffInItsPlace) {
  const TruthScene truth(stone(), *rig_);
  const RigRefinement refined = refine_rig_on_frames(knocked(kUpright, kByPeriod), {curves_, 1});
  ASSERT_TRUE(refined.report.refined) << refined.report.reason;
  EXPECT_LT(way(refined.rig.projectors[kUpright], rig_->projectors[kUpright]), 0.5);
  const auto points = triangulate(refined.rig, curves_->graphs, refined.labelings.front());
  EXPECT_LT(label_figures(truth, points, judge_points(truth, points)).wrong.value(), 0.01);
}

TEST_F(LostProjectors, ACheckedRigNamesOneThatIsRolledToo) {
  const RigFit fit =
      check_rig_over_frames(knocked(kAcross, kByHalfPeriodAndRoll), {curves_, 1}).front().fit;
  EXPECT_TRUE(fit.verdict == RigVerdict::kOneMoved || fit.verdict == RigVerdict::kSeveralMoved)
      << fit.text;
  EXPECT_TRUE(fit.devices[rig_->cameras.size() + kAcross].has_moved) << fit.text;
  EXPECT_LT(way(fit.put_back.projectors[kAcross], rig_->projectors[kAcross]), 1) << fit.text;
}

// On a plane, names a period off fit as well with another pose, in which half the way goes
// backwards.
TEST_F(LostProjectors, BeforeAPlateAPeriodOfTheCodeCannotBeToldAndTheRigIsRefused) {
  // It faces the third camera, and stands between the second and the third projector.
  TriangleMesh plate = make_box(Vec3(20, 260, 260) * kMm);
  const double azimuth = M_PI;
  for (Vec3& x : plate.vertices)
    x = Vec3(x.x() * std::cos(azimuth) - x.y() * std::sin(azimuth),
             x.x() * std::sin(azimuth) + x.y() * std::cos(azimuth), x.z());
  const FrameCurves curves = curves_of(*rig_, plate);
  const Rig rig = knocked(kUpright, {Vec3(0, 64, 0), Vec3::Zero()});
  EXPECT_FALSE(refine_rig_on_frames(rig, {&curves, 1}).report.refined);
}

}  // namespace
}  // namespace pencilscan
