#include "pencilscan/recording/pack.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "pencilscan/core/error.h"
#include "pencilscan/core/error_of.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/recording/frame_folders.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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
  EXPECT_EQ(report.frames, 3U);
  EXPECT_EQ(report.pictures, 5U);
  EXPECT_EQ(report.missing, 1U);
  const Recording recording = Recording::open(packed());
  EXPECT_EQ(recording.timestamp_ns(3, 1), 120000110);
  EXPECT_EQ(recording.timestamp_ns(2, 1), kUnknownTime);
  const FrameSets sets = group_frames(recording);
  EXPECT_TRUE(sets.by_row);
  const fs::path again = temporary_.path() / "again";
  const PackReport unpacked = unpack_recording(recording, sets, again);
  EXPECT_EQ(unpacked.frames, 3U);
  EXPECT_EQ(unpacked.pictures, 5U);
  EXPECT_EQ(unpacked.missing, 1U);
  EXPECT_THAT(unpacked.warnings, ElementsAre("rows of the recording that have no picture, and are "
                                             "no frames: 1 (000001)"));
  for (const char* file : {"000000/left.png", "000000/right.png", "000002/left.png",
                           "000003/left.png", "000003/right.png"})
    EXPECT_TRUE(equal_pixels(read_stored_image(frames() / file), read_stored_image(again / file)))
        << file;
  EXPECT_FALSE(fs::exists(again / "000002" / "right.png"));
  EXPECT_FALSE(fs::exists(again / "000001"));
  EXPECT_TRUE(fs::exists(again / "timestamps.csv"));
}

TEST_F(Pack, PicturesWhoseFilesAreGoneAreNamed) {
  for (const char* frame : {"000000", "000001", "000002"}) {
    put(std::string(frame) + "/left.png", CV_8UC1, 3);
    if (std::string(frame) != "000002") put(std::string(frame) + "/right.png", CV_8UC1, 4);
  }
  (void)pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  const FrameSets sets = group_frames(recording);
  // What was never taken is missing, and not lost.
  EXPECT_THAT(lost_pictures(recording, sets), ElementsAre(IsEmpty(), IsEmpty()));
  fs::remove(recording.picture_file(1, 1));
  EXPECT_THAT(lost_pictures(recording, sets), ElementsAre(IsEmpty(), ElementsAre(1U)));
  const PackReport unpacked = unpack_recording(recording, sets, temporary_.path() / "again");
  EXPECT_THAT(unpacked.warnings, ElementsAre("pictures of camera right that were recorded and "
                                             "whose files are no longer there: 1 (000001)"));
}

TEST_F(Pack, AFolderWithoutAPictureIsTold) {
  put("000000/cam0.png", CV_8UC1, 3);
  put("000002/cam0.png", CV_8UC1, 5);
  fs::create_directories(frames() / "000001");
  const PackReport report = pack_recording(frames(), packed());
  EXPECT_EQ(report.frames, 2U);
  EXPECT_THAT(report.warnings, ElementsAre("frame folders without a picture, which the recording "
                                           "does not hold: 1 (000001)"));
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

TEST_F(Pack, AnEarlierRecordingStaysUntilTheNewOneIsWhole) {
  put("000000/cam0.png", CV_8UC1, 3);
  put("000001/cam0.png", CV_8UC1, 4);
  pack_recording(frames(), packed());
  put("000000/cam0.png", CV_8UC1, 5);
  fs::resize_file(frames() / "000001" / "cam0.png", 60);
  PackOptions options;
  EXPECT_THAT(error_of([&] { pack_recording(frames(), packed(), options); }),
              HasSubstr("must be new"));
  options.overwrite = true;
  EXPECT_THAT(error_of([&] { pack_recording(frames(), packed() / "", options); }),
              HasSubstr("000001/cam0.png"));
  ASSERT_TRUE(Recording::is_one(packed()));
  EXPECT_EQ(Recording::open(packed()).read(0, 0).at<std::uint8_t>(0, 0), 3);
  EXPECT_EQ(Recording::open(packed()).row_count(), 2U);

  const fs::path other = temporary_.path() / "other.zarr";
  EXPECT_THROW(pack_recording(frames(), other), InputError);
  EXPECT_FALSE(fs::exists(other));

  put("000001/cam0.png", CV_8UC1, 6);
  pack_recording(frames(), packed() / "", options);
  EXPECT_EQ(Recording::open(packed()).read(1, 0).at<std::uint8_t>(0, 0), 6);
  EXPECT_TRUE(Recording::open(packed()).is_closed());
  EXPECT_FALSE(fs::exists(packed().string() + ".partial"));
}

TEST_F(Pack, AFilmIsNoEarlierRecording) {
  put("000000/cam0.png", CV_8UC1, 3);
  write_text(packed() / ".zgroup", "{\"zarr_format\": 2}");
  write_text(packed() / ".zattrs", "{\"format\": \"pencilscan-film/1\"}");
  PackOptions options;
  options.overwrite = true;
  EXPECT_THAT(error_of([&] { pack_recording(frames(), packed(), options); }),
              HasSubstr("must be new or an empty folder"));
  EXPECT_TRUE(fs::exists(packed() / ".zattrs"));
}

TEST_F(Pack, TheFramesThemselvesAreNoOutput) {
  put("000000/cam0.png", CV_8UC1, 3);
  write_text(frames() / ".zgroup", "{\"zarr_format\": 2}");
  write_text(temporary_.path() / ".zgroup", "{\"zarr_format\": 2}");
  PackOptions options;
  options.overwrite = true;
  for (const fs::path& out : {frames(), frames() / "", temporary_.path()})
    EXPECT_THAT(error_of([&] { pack_recording(frames(), out, options); }),
                HasSubstr("must not be the folder of --frames"));
  for (const fs::path& out : {frames() / "film.zarr", frames() / "000000" / "film.zarr"})
    EXPECT_THAT(error_of([&] { pack_recording(frames() / "", out); }),
                HasSubstr("must not lie in that of --frames"));
  EXPECT_FALSE(fs::exists(frames() / "film.zarr"));
  EXPECT_TRUE(fs::exists(frames() / "000000" / "cam0.png"));
}

TEST_F(Pack, FramesThatAreCountedComeInTheOrderOfTheirNumbers) {
  for (const char* name : {"1", "2", "3", "10", ".ipynb_checkpoints"})
    put(std::string(name) + "/cam0.png", CV_8UC1, 3);
  EXPECT_THAT(frame_folder_names(frames()), ElementsAre("1", "2", "3", "10"));
  pack_recording(frames(), packed());
  EXPECT_EQ(Recording::open(packed()).row_count(), 4U);
  put("02/cam0.png", CV_8UC1, 3);
  put("000/cam0.png", CV_8UC1, 3);
  EXPECT_THAT(frame_folder_names(frames()), ElementsAre("000", "1", "02", "2", "3", "10"));
  put("b/cam0.png", CV_8UC1, 3);
  EXPECT_THAT(frame_folder_names(frames()), ElementsAre("000", "02", "1", "10", "2", "3", "b"));
}

TEST_F(Pack, AnOrderOfNamesThatIsNotThatOfTheirNumbersIsSaid) {
  const auto warning = [](std::vector<std::string> names) { return order_warning(names); };
  EXPECT_FALSE(warning({"000000", "000001"}));
  EXPECT_FALSE(warning({"1", "2", "10"}));
  EXPECT_FALSE(warning({"shot_01", "shot_02", "shot_10"}));
  EXPECT_FALSE(warning({"a10", "b2"}));
  EXPECT_FALSE(warning({"shot", "shot_1", "shot_1b"}));
  EXPECT_TRUE(warning({"10_left", "9_left"}));
  for (const char* name : {"shot_1", "shot_2", "shot_10"})
    put(std::string(name) + "/cam0.png", CV_8UC1, 3);
  EXPECT_THAT(pack_recording(frames(), packed()).warnings,
              ElementsAre(HasSubstr("in which shot_10 comes before shot_2:")));
}

TEST_F(Pack, PicturesThatWouldStayAmongUnpackedOnesAreNamed) {
  put("000000/cam0.png", CV_8UC1, 3);
  put("000001/cam0.png", CV_8UC1, 4);
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  const FrameSets sets = group_frames(recording);
  const fs::path out = temporary_.path() / "out";
  write_text(out / "notes.txt", "mine");
  write_text(out / "notes" / "a.txt", "mine");
  unpack_recording(recording, sets, out);
  EXPECT_EQ(unpack_recording(recording, sets, out).pictures, 2U);  // all of it is written anew
  for (const char* file : {"000002/cam0.png", "000001/cam1.png", "000001/cam0.tiff"}) {
    const cv::Mat picture(12, 16, CV_8UC1, cv::Scalar(9));
    write_image(out / file, picture);
    EXPECT_NE(error_of([&] { unpack_recording(recording, sets, out); }), "") << file;
    EXPECT_TRUE(fs::exists(out / file));
    fs::remove(out / file);
  }
  write_image(out / "000002" / "cam0.png", cv::Mat(12, 16, CV_8UC1, cv::Scalar(9)));
  EXPECT_THAT(error_of([&] { unpack_recording(recording, sets, out); }),
              HasSubstr("000002/cam0.png: must not stay"));
  fs::remove(out / "000002" / "cam0.png");
  write_text(out / "timestamps.csv", "frame,cam0\n000000,1\n");
  EXPECT_THAT(error_of([&] { unpack_recording(recording, sets, out); }),
              HasSubstr("timestamps.csv: must not stay"));
}

TEST_F(Pack, ANewFolderOfFramesAppearsWhole) {
  put("000000/cam0.png", CV_8UC1, 3);
  put("000001/cam0.png", CV_8UC1, 4);
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  const FrameSets sets = group_frames(recording);
  write_text(recording.picture_file(1, 0), "no picture");
  const fs::path out = temporary_.path() / "out";
  EXPECT_NE(error_of([&] { unpack_recording(recording, sets, out); }), "");
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(Pack, NothingIsUnpackedIntoTheRecording) {
  put("000000/cam0.png", CV_8UC1, 3);
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  const FrameSets sets = group_frames(recording);
  EXPECT_THAT(error_of([&] { unpack_recording(recording, sets, packed()); }),
              HasSubstr("must not be that of --frames"));
  EXPECT_THAT(error_of([&] { unpack_recording(recording, sets, packed() / "frames"); }),
              HasSubstr("must not lie in that of --frames"));
  EXPECT_FALSE(fs::exists(packed() / "000000"));
  EXPECT_FALSE(fs::exists(packed() / "frames"));
}

TEST_F(Pack, TheTimesOfOneRowComeBack) {
  put("000000/cam0.png", CV_8UC1, 3);
  put("000000/cam1.png", CV_8UC1, 4);
  const std::string table = "frame,cam0,cam1\n000000,100,110\n";
  write_text(frames() / "timestamps.csv", "\xEF\xBB\xBF" + table);  // as Excel saves it
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  const fs::path out = temporary_.path() / "out";
  unpack_recording(recording, group_frames(recording), out);
  EXPECT_EQ(read_file(out / "timestamps.csv"), table);
  unpack_recording(recording, group_frames(recording), out);  // it is written anew
}

TEST_F(Pack, TimeStampsAndPicturesWithoutAPartnerAreSaid) {
  for (const char* frame : {"000000", "000001"}) {
    for (const char* camera : {"cam0", "cam1"})
      put(std::string(frame) + "/" + camera + ".png", CV_8UC1, 3);
  }
  const auto with = [&](const std::string& times) {
    fs::remove_all(packed());
    write_text(frames() / "timestamps.csv", times);
    return error_of([&] { pack_recording(frames(), packed()); });
  };
  EXPECT_THAT(with("frame,Cam0,cam1\n000000,1,2\n"),
              AllOf(HasSubstr("timestamps.csv"), HasSubstr("line 1"), HasSubstr("Cam0"),
                    HasSubstr("must be a camera that has pictures (cam0, cam1)")));
  EXPECT_THAT(with("frame,cam0,cam0\n000000,1,2\n"), HasSubstr("must stand once"));
  EXPECT_THAT(with("frame,cam0,cam1\n000000,1,2\n000000,3,4\n"),
              AllOf(HasSubstr("line 3"), HasSubstr("000000"),
                    HasSubstr("must stand once; it stands in line 2")));
  EXPECT_THAT(with("frame,cam0,cam1\n0,1,2\n1,3,4\n"),
              AllOf(HasSubstr("must be the name of a frame folder, such as 000001")));
  EXPECT_FALSE(fs::exists(packed()));
  write_text(frames() / "timestamps.csv", "frame,cam0,cam1\n000000,1,2\n000001,3,\n000002,5,6\n");
  EXPECT_THAT(pack_recording(frames(), packed()).warnings,
              ElementsAre(HasSubstr("rows of no frame folder: 1 (000002)"),
                          HasSubstr("pictures of camera cam1 without a time stamp: 1 (000001)")));
}

TEST_F(Pack, PicturesThatAreInNoFrameAreSaid) {
  for (std::size_t k = 0; k < 6; ++k) {
    for (const char* camera : {"cam0", "cam1", "cam2"}) {
      if (k < 5 || std::string(camera) != "cam1")
        put(six_digits(k) + "/" + camera + ".png", CV_8UC1, static_cast<int>(k));
    }
  }
  // cam1 dropped the moment 2 ms; nothing tells whether its last picture is of the last moment.
  write_text(frames() / "timestamps.csv",
             "frame,cam0,cam1,cam2\n000000,0,0,0\n000001,1000000,1000000,1000000\n"
             "000002,2000000,3000000,2000000\n000003,3000000,4000000,3000000\n"
             "000004,4000000,,4000000\n000005,5000000,,5000000\n");
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  EXPECT_THAT(
      unpack_recording(recording, group_frames(recording), temporary_.path() / "out").warnings,
      ElementsAre(AllOf(HasSubstr("camera cam1"), HasSubstr("1 (000004)"))));
}

TEST_F(Pack, TimesInAnotherUnitAreNamed) {
  for (std::size_t k = 0; k < 4; ++k) put(six_digits(k) + "/cam0.png", CV_8UC1, 1);
  for (const auto& [step, is_named] : {std::pair(40, true), {40'000, true}, {40'000'000, false}}) {
    std::string table = "frame,cam0\n";
    for (int k = 0; k < 4; ++k)
      table += six_digits(static_cast<std::size_t>(k)) + "," + std::to_string(k * step) + "\n";
    write_text(frames() / "timestamps.csv", table + " \r\n");
    PackOptions options;
    options.overwrite = true;
    pack_recording(frames(), packed(), options);
    const Recording recording = Recording::open(packed());
    const auto warnings = recording_warnings(recording, group_frames(recording));
    EXPECT_EQ(is_named ? 1U : 0U, warnings.size()) << step;
    for (const std::string& warning : warnings)
      EXPECT_THAT(warning, HasSubstr("they must be nanoseconds"));
  }
  write_text(frames() / "timestamps.csv", "frame,cam0\n000000,1,2\n");
  EXPECT_THAT(error_of([&] { pack_recording(frames(), packed() / "more"); }),
              HasSubstr("no more cells than line 1: 2"));
}

TEST_F(Pack, TimesThatDoNotGrowAreNamed) {
  std::string table = "frame,cam0\n";
  for (std::size_t k = 0; k < 6; ++k) {
    put(six_digits(k) + "/cam0.png", CV_8UC1, 1);
    // Of the fourth a digit was lost.
    table += six_digits(k) + "," + std::to_string(k == 3 ? 12'000'000 : k * 40'000'000) + "\n";
  }
  write_text(frames() / "timestamps.csv", table);
  const auto names_it =
      ElementsAre(HasSubstr("camera cam0 that do not come after the one before, at 1 (000003)"));
  EXPECT_THAT(pack_recording(frames(), packed()).warnings, names_it);
  const Recording recording = Recording::open(packed());
  EXPECT_THAT(recording_warnings(recording, group_frames(recording)), names_it);
}

TEST_F(Pack, ProgressEndsAtTheEnd) {
  for (std::size_t k = 0; k < 3; ++k) {
    put(six_digits(k) + "/cam0.png", CV_8UC1, 3);
    put(six_digits(k) + "/cam1.png", CV_8UC1, 3);
  }
  double last = 0;
  pack_recording(frames(), packed(), {}, [&](std::string_view, double share) { last = share; });
  EXPECT_EQ(last, 1);
}

TEST_F(Pack, UnpackingTellsHowFarItIsOneCallAtATime) {
  constexpr std::size_t kFrames = 40;
  for (std::size_t k = 0; k < kFrames; ++k) put(six_digits(k) + "/cam0.png", CV_8UC1, 3);
  pack_recording(frames(), packed());
  const Recording recording = Recording::open(packed());
  std::atomic<int> inside{0};
  std::atomic<bool> overlapped{false};
  std::vector<double> shares;
  unpack_recording(recording, group_frames(recording), temporary_.path() / "again",
                   [&](std::string_view, double share) {
                     if (++inside > 1) overlapped = true;
                     if (!overlapped) shares.push_back(share);
                     std::this_thread::sleep_for(std::chrono::milliseconds(1));
                     --inside;
                   });
  EXPECT_FALSE(overlapped);
  EXPECT_EQ(shares.size(), kFrames);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.back(), 1);
}

TEST_F(Pack, ATimeStampThatIsNoWholeNumberIsRefused) {
  put("000000/cam0.png", CV_8UC1, 3);
  const auto with = [&](const std::string& time) {
    fs::remove_all(packed());
    write_text(frames() / "timestamps.csv", "frame,cam0\n000000," + time + "\n");
    return error_of([&] { pack_recording(frames(), packed()); });
  };
  EXPECT_THAT(with("9223372036854775808"),
              AllOf(HasSubstr("timestamps.csv"), HasSubstr("line 2, cam0"),
                    HasSubstr("9223372036854775808"), HasSubstr("must be whole nanoseconds")));
  EXPECT_THAT(with("12x"), HasSubstr("12x"));
  EXPECT_EQ(with("9223372036854775807"), "");
  EXPECT_EQ(Recording::open(packed()).timestamp_ns(0, 0), 9223372036854775807);
  EXPECT_EQ(with(""), "");
}

}  // namespace
}  // namespace pencilscan
