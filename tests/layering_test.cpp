#include "layering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// The layers as CMakeLists.txt builds them, bottom first.
std::vector<std::string> built_layers() {
  std::istringstream words(PENCILSCAN_LAYERS);
  std::vector<std::string> layers;
  for (std::string word; words >> word;) layers.push_back(word);
  return layers;
}

LayeringRules project_rules() {
  return {built_layers(),
          "simulation",
          {"view", "detection", "grid", "labeling", "points", "paper", "joint", "guided", "depth",
           "surface"}};
}

/// The layers as docs/architecture.md lists them: the first word of each line of the block after
/// the heading "Layers".
std::vector<std::string> documented_layers() {
  std::ifstream file(fs::path(PENCILSCAN_SOURCE_DIR) / "docs" / "architecture.md");
  std::vector<std::string> layers;
  bool in_section = false;
  bool in_block = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("## ")) in_section = line == "## Layers";
    if (!in_section) continue;
    if (line.starts_with("```")) {
      in_block = !in_block;
    } else if (in_block && !line.empty() && line.front() != ' ') {
      layers.push_back(line.substr(0, line.find(' ')));
    }
  }
  return layers;
}

/// A source tree of made-up modules that is removed at the end.
class SourceTree {
 public:
  SourceTree() : root_(fs::temp_directory_path() / ("layering_" + std::to_string(::getpid()))) {
    fs::create_directories(root_);
  }
  ~SourceTree() { fs::remove_all(root_); }
  SourceTree(const SourceTree&) = delete;
  SourceTree& operator=(const SourceTree&) = delete;

  void add(const std::string& file, const std::string& text) const {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  [[nodiscard]] const fs::path& root() const { return root_; }

 private:
  fs::path root_;
};

TEST(Layering, HoldsForEveryIncludeOfTheProject) {
  const fs::path root = fs::path(PENCILSCAN_SOURCE_DIR) / "src" / "pencilscan";
  EXPECT_THAT(layering_violations(root, project_rules()), IsEmpty());
}

TEST(Layering, DocumentListsTheLayersInBuildOrder) {
  EXPECT_EQ(documented_layers(), built_layers());
}

TEST(Layering, FindsAnIncludeOfAHigherLayer) {
  const SourceTree tree;
  tree.add("low/a.h", "#pragma once\n");
  tree.add("low/b.cpp", "#include \"pencilscan/low/a.h\"\n\n#include <pencilscan/high/c.h>\n");
  tree.add("high/c.h", "#include \"pencilscan/low/a.h\"\n");
  EXPECT_THAT(layering_violations(tree.root(), {{"low", "high"}, "", {}}),
              ElementsAre("low/b.cpp:3: low includes high, which lies above it"));
  EXPECT_THAT(layering_violations(tree.root(), {{"high", "low"}, "", {}}),
              ElementsAre("high/c.h:1: high includes low, which lies above it"));
}

TEST(Layering, FindsProductCodeThatIncludesItsOracle) {
  const SourceTree tree;
  tree.add("oracle/o.h", "");
  tree.add("judged/a.cpp", "#include \"pencilscan/oracle/o.h\"\n");
  tree.add("judged/a_test.cpp", "#include \"pencilscan/oracle/o.h\"\n");
  EXPECT_THAT(layering_violations(tree.root(), {{"oracle", "judged"}, "oracle", {"judged"}}),
              ElementsAre("judged/a.cpp:1: judged includes oracle, its oracle"));
}

TEST(Layering, FindsFoldersAndIncludesOutsideTheLayers) {
  const SourceTree tree;
  tree.add("low/a.cpp", "#include \"pencilscan/util/u.h\"\n");
  tree.add("util/u.h", "");
  EXPECT_THAT(layering_violations(tree.root(), {{"low"}, "", {}}),
              ElementsAre("low/a.cpp:1: includes util, which is no layer", "util: is no layer"));
}

TEST(Layering, EachTypeHasAName) {
  EXPECT_THAT(repeated_types(fs::path(PENCILSCAN_SOURCE_DIR) / "src" / "pencilscan"), IsEmpty());
}

TEST(Layering, FindsATypeOfTwoHeaders) {
  const SourceTree tree;
  tree.add("low/a.h", "struct Sample {\n};\nstruct Other;\n");
  tree.add("high/b.h", "class Sample : public Base {\n};\nclass Other {};\n");
  EXPECT_THAT(repeated_types(tree.root()), ElementsAre("Sample: high/b.h and low/a.h"));
}

}  // namespace
}  // namespace pencilscan
