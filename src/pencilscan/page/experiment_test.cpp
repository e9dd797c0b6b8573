#include "pencilscan/page/experiment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <opencv2/core.hpp>

#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/page/page.h"
#include "pencilscan/page/sample_result.h"
#include "pencilscan/page/table_file.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kTable = "A title\n\n| method | error |\n|---|---|\n| joint | 0.01 |\n";
constexpr const char* kDrawing =
    "<svg xmlns=\"http://www.w3.org/2000/svg\"><script>window.ran = 1</script></svg>";

class Experiment : public ::testing::Test {
 protected:
  void write_noise(const fs::path& file, int width, int height) const {
    cv::Mat image(height, width, CV_8UC3);
    cv::theRNG().state = 3;
    cv::randu(image, 0, 256);
    write_image(root_ / file, image);
  }
  ExperimentPage read(const ExperimentDetail& detail = {}) const {
    return read_experiment(find_experiment(root_).value(), detail);
  }
  static std::vector<std::string> missing(const ExperimentPage& page) {
    std::vector<std::string> what;
    for (const auto& entry : page.json["missing"]) what.push_back(entry["what"]);
    return what;
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path root_ = temporary_.path();
};

TEST(MarkdownTables, HaveTheParagraphBeforeThemAsTitle) {
  const auto tables = markdown_tables(
      "# First\n\nwords\n\nof two\nlines\n\n| a | b \\| c |\n|---|:-:|\n| 1 | 2 |\n| 3 |\n| 4 | 5 "
      "| "
      "6 |\n\n| no | rule |\n\nSecond\n|x|\n|-|\n");
  ASSERT_EQ(tables.size(), 2U);
  EXPECT_EQ(tables[0].title, "of two lines");
  EXPECT_THAT(tables[0].header, ElementsAre("a", "b | c"));
  EXPECT_THAT(tables[0].rows,
              ElementsAre(ElementsAre("1", "2"), ElementsAre("3", ""), ElementsAre("4", "5")));
  EXPECT_EQ(tables[1].title, "Second");
  EXPECT_THAT(tables[1].header, ElementsAre("x"));
  EXPECT_TRUE(tables[1].rows.empty());
  EXPECT_TRUE(markdown_tables("").empty());
  EXPECT_TRUE(markdown_tables("|---|\n| a |\n").empty());  // a rule without a header
}

TEST(CsvTable, FollowsRfc4180) {
  const TextTable table = csv_table("a,\"b, \"\"c\"\"\"\r\n1,\"two\nlines\"\r\n\r\n3\r\n");
  EXPECT_THAT(table.header, ElementsAre("a", "b, \"c\""));
  EXPECT_THAT(table.rows, ElementsAre(ElementsAre("1", "two\nlines"), ElementsAre("3", "")));
  EXPECT_TRUE(csv_table("").header.empty());
  EXPECT_THAT(csv_table("\"open, and never closed").header, ElementsAre("open, and never closed"));
}

TEST_F(Experiment, IsNotSeenInTheFolderOfAReconstruction) {
  sample::write_output(root_, 1);
  EXPECT_FALSE(find_experiment(root_).has_value());
  const PageData data(root_, {});
  EXPECT_TRUE(data.index("report", {})["experiment"].is_null());
}

TEST_F(Experiment, HasItsTablesPicturesAndRuns) {
  write_text(root_ / "sweep.md", kTable);
  write_text(root_ / "table.md", kTable);
  write_text(root_ / "results.csv", "method,error\njoint,0.01\n");
  write_text(root_ / "plot.svg", kDrawing);
  write_noise("photo.png", 20, 10);
  write_noise("pictures/000_cam0.png", 20, 10);
  write_json(root_ / "experiment.json", {{"title", "A sweep"}, {"setting", "small"}, {"text", 3}});
  write_text(root_ / "commands.log", "one\ntwo\n");
  sample::write_output(root_ / "work" / "deep" / "out", 1);
  write_json(root_ / "work" / "calibrated" / "calibration.json", {{"verdict", "good"}});

  const ExperimentPage page = read();
  EXPECT_EQ(page.json["title"], "A sweep");
  EXPECT_FALSE(page.json.contains("text"));  // which is no text
  ASSERT_EQ(page.json["tables"].size(), 3U);
  EXPECT_EQ(page.json["tables"][0]["file"], "table.md");
  EXPECT_EQ(page.json["tables"][2]["rows"][0][1], "0.01");
  ASSERT_EQ(page.json["pictures"].size(), 3U);
  EXPECT_EQ(page.json["pictures"][1]["type"], "image/svg+xml");
  EXPECT_EQ(page.json["pictures"][2]["group"], "pictures");
  ASSERT_EQ(page.json["runs"].size(), 2U);
  EXPECT_EQ(page.json["runs"][0]["verdict"], "good");
  EXPECT_EQ(page.json["runs"][1]["folder"], "work/deep/out/000000");
  EXPECT_GT(page.json["runs"][1]["summary"]["points"], 100);
  EXPECT_EQ(page.json["commands"].size(), 2U);
  EXPECT_TRUE(page.json["missing"].empty()) << page.json["missing"];
}

TEST_F(Experiment, SaysWhatIsMissingOrBroken) {
  write_text(root_ / "commands.log", "");
  EXPECT_THAT(missing(read()), ElementsAre("table.md", "results.csv"));
  write_text(root_ / "table.md", "no table here\n");
  write_text(root_ / "results.csv", "method,error\n");
  write_text(root_ / "experiment.json", "{");
  write_text(root_ / "a.png", "no picture");
  write_text(root_ / "b.svg", "<html></html>");
  write_text(root_ / "c.webp", "RIFF");
  write_text(root_ / "d.gif", "");
  const ExperimentPage page = read();
  EXPECT_THAT(missing(page), ElementsAre("experiment.json", "table.md", "results.csv", "a.png",
                                         "b.svg", "c.webp", "d.gif"));
  EXPECT_TRUE(page.json["pictures"].empty());
}

TEST_F(Experiment, LargePicturesShrinkAndWhatDoesNotFitIsLeftOut) {
  write_text(root_ / "table.md", kTable);
  write_text(root_ / "results.csv", "a\n1\n");
  write_noise("large.png", 900, 300);
  for (const char* frame : {"000", "001", "002", "003"}) {
    write_noise("pictures/" + std::string(frame) + "_a.png", 100, 80);
    write_noise("pictures/" + std::string(frame) + "_b.png", 100, 80);
  }
  ExperimentDetail detail;
  detail.max_width = 300;
  const ExperimentPage all = read(detail);
  EXPECT_EQ(all.pictures.size(), 9U);
  EXPECT_EQ(all.json["pictures"][0]["type"], "image/webp");
  EXPECT_EQ(all.json["pictures"][0]["width"], 900);  // of the file
  EXPECT_LT(all.pictures[0].size(), fs::file_size(root_ / "large.png") / 5);

  std::size_t total = 0;
  for (const std::string& picture : all.pictures) total += picture.size();
  detail.max_bytes = total;  // base64 takes a third more
  const ExperimentPage some = read(detail);
  EXPECT_LT(some.pictures.size(), 9U);
  EXPECT_EQ(some.pictures.size() % 2, 1U);  // both pictures of a frame, or none
  EXPECT_THAT(missing(some), ElementsAre("pictures/"));
  detail.max_bytes = 100;
  EXPECT_THAT(missing(read(detail)), ElementsAre("large.png", "pictures/"));
}

TEST_F(Experiment, ARunWithoutASurfaceHasNoShareOfIt) {
  write_text(root_ / "table.md", kTable);
  sample::write_output(root_ / "work" / "deep" / "out", 1);
  EXPECT_EQ(read().json["runs"][0]["summary"]["measured_share"], 0.5);
  fs::remove(root_ / "work" / "deep" / "out" / "000000" / "mesh.ply");
  EXPECT_FALSE(read().json["runs"][0]["summary"].contains("measured_share"));
}

TEST_F(Experiment, ItsPageHoldsDrawingsAsDataOnly) {
  write_text(root_ / "table.md", kTable);
  write_text(root_ / "plot.svg", kDrawing);
  sample::write_output(root_ / "joint", 1);
  const PageReport report = write_report(root_, root_ / "report.html");
  EXPECT_EQ(report.results, 1U);
  EXPECT_THAT(report.missing, ElementsAre(HasSubstr("results.csv")));
  const std::string page = read_file(root_ / "report.html");
  EXPECT_THAT(page, HasSubstr("id=\"part/experiment/0\""));
  EXPECT_THAT(page, Not(HasSubstr("window.ran")));
  // The run that the page shows whole is not listed once more.
  EXPECT_THAT(page, HasSubstr("\"runs\":[]"));
  const std::string again = read_file(root_ / "report.html");
  static_cast<void>(write_report(root_, root_ / "report.html"));
  EXPECT_EQ(read_file(root_ / "report.html"), again);
}

}  // namespace
}  // namespace pencilscan
