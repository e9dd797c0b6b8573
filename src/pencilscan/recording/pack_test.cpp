#include "pencilscan/recording/pack.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "pencilscan/core/error.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

class Pack : public ::testing::Test {
 protected:
  fs::path frames() { return temporary_.path() / "frames"; }
  fs::path packed() { return temporary_.path() / "recording.zarr"; }
  void put(const std::string& file, int type, int value, cv::Size size = {16, 12}) {
    write_image(frames() / file, cv::Mat(size, type, cv::Scalar::all(value)),
                CV_MAT_DEPTH(type) == CV_8U ? 8 : 16);
  }

  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
};

bool equal_pixels(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST_F(Pack, FoldersComeBackAsTheyWere) {
  put("000000/left.png", CV_8UC1, 3);
  put("000000/right.png", CV_16UC3, 1234);
  put("000002/left.png", CV_8UC1, 5);
  put("000003/left.png", CV_8UC1, 7);
  put("000003/right.png", CV_16UC3, 4321);
  std::ofstream(frames() / "timestamps.csv")
      << "frame,left,right\n000000,100,110\n000002,80000100,\n000003,120000100,120000110\n";
  const PackReport report = pack_recording(frames(), packed());
  EXPECT_EQ(report.frames, 4U);
  EXPECT_EQ(report.pictures, 5U);
  EXPECT_EQ(report.missing, 3U);
  const Recording recording = Recording::open(packed());
  EXPECT_EQ(recording.timestamp_ns(3, 1), 120000110);
  EXPECT_EQ(recording.timestamp_ns(2, 1), kUnknownTime);
  const FrameSets sets = group_frames(recording);
  EXPECT_TRUE(sets.by_row);
  const fs::path again = temporary_.path() / "again";
  EXPECT_EQ(unpack_recording(recording, sets, again).pictures, 5U);
  for (const char* file : {"000000/left.png", "000000/right.png", "000002/left.png",
                           "000003/left.png", "000003/right.png"})
    EXPECT_TRUE(equal_pixels(read_stored_image(frames() / file), read_stored_image(again / file)))
        << file;
  EXPECT_FALSE(fs::exists(again / "000002" / "right.png"));
  EXPECT_TRUE(fs::exists(again / "timestamps.csv"));
}

TEST_F(Pack, PicturesOfAnotherKindAreRefusedByName) {
  put("a/cam0.png", CV_8UC1, 3);
  put("b/cam0.png", CV_8UC3, 3);
  try {
    pack_recording(frames(), packed());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("b/cam0.png"),
                                               ::testing::HasSubstr("16x12 colour, 8 bit"),
                                               ::testing::HasSubstr("16x12 grey, 8 bit")));
  }
}

}  // namespace
}  // namespace pencilscan
