#include "pencilscan/refinement/shown_colors.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "pencilscan/labeling/two_projector_scene.h"

namespace pencilscan {
namespace {

/// The scene of two projectors with its lines named `off[p]` lines too far.
class ShownColorsTest : public ::testing::Test {
 protected:
  std::vector<ShownColors> shown_with(std::array<int, 2> off) {
    TwoProjectorScene scene;
    change(scene);
    Labeling labeling;
    std::vector<GridGraph> graphs;
    for (const int camera : {0, 1}) {
      graphs.push_back(scene.graph(camera, 60, 0.02, 3));
      int drawn = 0;
      for (Curve& curve : graphs.back().curves) {
        const bool is_painted = ++drawn % 5 < painted_fifths_;
        if (curve.family >= seen_in_one_color_ && !is_painted) continue;
        // Of blue and cyan, and of red and yellow, the first is what is left of the second.
        for (std::size_t k = 0; k < curve.code.size(); ++k) curve.code[k] = k % 2 == 0 ? 0 : -5;
      }
      const GridGraph& graph = graphs.back();
      std::vector<LabeledRun>& runs = labeling.runs.emplace_back();
      for (std::size_t i = 0; i < graph.curves.size(); ++i) {
        const int p = graph.curves[i].family;
        if (p == 1 && static_cast<int>(i) % one_in_ != 0) continue;
        const int line = scene.true_lines[camera][i] + off[static_cast<std::size_t>(p)];
        runs.push_back({static_cast<int>(i),
                        0,
                        static_cast<int>(graph.curves[i].points.size()),
                        {{p, 0}, line, static_cast<double>(line), 1}});
      }
    }
    ShownColorCount count(scene.rig);
    for (int frame = 0; frame < frames_; ++frame) count.add(scene.families, graphs, labeling);
    denied_ = count.denied();
    return count.shown();
  }
  int seen_in_one_color_ = 0;  ///< so many projectors
  int painted_fifths_ = 0;     ///< of the curves are on a surface that is not green
  int one_in_ = 1;             ///< curves of the second one has a name
  int frames_ = 1;
  std::string denied_;
  virtual void change(TwoProjectorScene& /*scene*/) {}
};

TEST_F(ShownColorsTest, RightNamesHaveTheirColors) {
  for (const ShownColors& shown : shown_with({0, 0})) {
    EXPECT_GE(shown.runs, 30U);
    EXPECT_DOUBLE_EQ(shown.chance, 0.5);
    EXPECT_DOUBLE_EQ(shown.share, 1);
    EXPECT_FALSE(shown.deny());
    EXPECT_EQ(shown.better_shift(), 0);
  }
}

TEST_F(ShownColorsTest, NamesThatAreLinesOffAreDeniedAndTheWayBackIsFound) {
  for (const int off : {-3, -1, 2, 3}) {
    const std::vector<ShownColors> shown = shown_with({0, off});
    EXPECT_FALSE(shown[0].deny()) << off;
    EXPECT_TRUE(shown[1].deny()) << off;
    EXPECT_EQ(shown[1].better_shift(), -off) << off;
  }
  // Half a period: the way back is one of two.
  EXPECT_EQ(std::abs(shown_with({4, 0})[0].better_shift()), 4);
}

TEST_F(ShownColorsTest, LinesThatAllLookAlikeSayNothingOfTheirNames) {
  for (const ShownColors& shown : shown_with({0, 0})) EXPECT_FALSE(shown.all_look_alike());
  for (const ShownColors& shown : shown_with({0, 3})) EXPECT_FALSE(shown.all_look_alike());
  seen_in_one_color_ = 2;
  for (const int off : {0, 3}) {
    for (const ShownColors& shown : shown_with({0, off})) {
      EXPECT_TRUE(shown.all_look_alike()) << off;
      EXPECT_FALSE(shown.deny()) << off;
      EXPECT_EQ(shown.better_shift(), 0) << off;
    }
  }
}

TEST_F(ShownColorsTest, LinesThatAllLookAlikeDoNotAccuseTheCamerasThatSeeThem) {
  // Most of what the cameras see says as little as chance.
  seen_in_one_color_ = 1;
  one_in_ = 3;
  frames_ = 3;  // enough for each camera
  const std::vector<ShownColors> shown = shown_with({0, 0});
  EXPECT_TRUE(shown[0].all_look_alike());
  EXPECT_FALSE(shown[1].all_look_alike());
  EXPECT_EQ(denied_, "");
}

TEST_F(ShownColorsTest, AColoredObjectDeniesNoRightName) {
  painted_fifths_ = 3;
  frames_ = 2;
  for (const ShownColors& shown : shown_with({0, 0})) {
    EXPECT_FALSE(shown.all_look_alike());
    EXPECT_LT(shown.share, 0.75);
    EXPECT_GE(shown.firm_runs, 8U);
    EXPECT_DOUBLE_EQ(shown.firm_share, 1);
    EXPECT_FALSE(shown.deny());
  }
  EXPECT_EQ(denied_, "");
}

TEST_F(ShownColorsTest, OnAColoredObjectWrongNamesAreStillDenied) {
  painted_fifths_ = 2;
  frames_ = 3;
  const std::vector<ShownColors> shown = shown_with({0, 3});
  EXPECT_FALSE(shown[0].deny());
  EXPECT_TRUE(shown[1].deny());
}

class ColorsThatDoNotTell : public ShownColorsTest {
  void change(TwoProjectorScene& scene) override { scene.code_evidence = 0; }
};

TEST_F(ColorsThatDoNotTell, DenyNothing) {
  for (const ShownColors& shown : shown_with({0, 3})) EXPECT_FALSE(shown.deny());
}

}  // namespace
}  // namespace pencilscan
