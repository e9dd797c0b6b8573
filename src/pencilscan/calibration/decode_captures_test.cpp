#include "pencilscan/calibration/decode_captures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pencilscan/core/random.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/pattern/gray_code.h"

namespace pencilscan {
namespace {

using ::testing::HasSubstr;

constexpr int kSize = 16;

/// Pictures of nothing: what they show does not matter here.
void write_capture(const std::filesystem::path& folder, std::uint64_t seed) {
  Random random(seed);
  for (std::size_t i = 0; i < gray_code_sequence(kSize, kSize, true).size(); ++i) {
    cv::Mat picture(kSize, kSize, CV_8U);
    for (int k = 0; k < kSize * kSize; ++k)
      picture.data[k] = static_cast<std::uint8_t>(random.below(256));
    const std::string number = std::to_string(1000 + i).substr(1) + ".png";
    write_image(folder / "proj0/cam0" / number, picture);
  }
}

TEST(DecodeCaptures, CopiesOfACaptureAreNamedAndLeftOut) {
  const TemporaryFolder folder("decode_captures");
  Rig rig;
  rig.cameras.emplace_back();
  rig.projectors.emplace_back();
  rig.cameras[0].name = "cam0";
  rig.projectors[0].name = "proj0";
  rig.cameras[0].width = rig.cameras[0].height = kSize;
  rig.projectors[0].width = rig.projectors[0].height = kSize;
  std::vector<std::filesystem::path> poses;
  for (const char* name : {"pose0", "pose1", "pose2", "pose3"})
    poses.push_back(folder.path() / name);
  for (std::size_t k = 0; k < poses.size(); ++k) write_capture(poses[k], k == 1 ? 1 : 0);
  write_image(poses[3] / "proj0/cam0/000.png", cv::Mat(kSize, kSize, CV_8U, cv::Scalar(200)));

  const DecodedCaptures decoded = decode_captures(rig, poses, "", 100);
  std::vector<std::string> copies;
  for (const Finding& finding : decoded.findings)
    if (finding.what.find("the same pictures") != std::string::npos) copies.push_back(finding.what);
  ASSERT_EQ(copies.size(), 1U);
  EXPECT_THAT(copies[0],
              HasSubstr(poses[2].string() + " holds the same pictures as " + poses[0].string()));
  std::vector<std::size_t> captures;
  for (const DecodeSummary& pair : decoded.pairs) captures.push_back(pair.capture);
  EXPECT_EQ(captures, (std::vector<std::size_t>{0, 1, 3}));
}

}  // namespace
}  // namespace pencilscan
