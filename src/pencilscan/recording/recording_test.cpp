#include "pencilscan/recording/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "pencilscan/core/error.h"
#include "pencilscan/core/error_of.h"
#include "pencilscan/core/random.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/recording/recording_writer.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

class RecordingFolder : public ::testing::Test {
 protected:
  TemporaryFolder temporary_{::testing::UnitTest::GetInstance()->current_test_info()->name()};
  fs::path folder_ = temporary_.path() / "recording.zarr";
};

std::vector<RecordedCamera> three_kinds() {
  return {{"cam0", 37, 23, 1, 8, 4000}, {"cam1", 20, 11, 3, 16, 4000}, {"cam2", 20, 11, 1, 16, 0}};
}

/// A picture that no other row or camera has.
cv::Mat picture(const RecordedCamera& camera, std::size_t row, std::size_t seed = 0) {
  cv::Mat image(camera.height, camera.width, camera.image_type());
  Random random(row, seed + std::hash<std::string>()(camera.name));
  for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i)
    image.data[i] = static_cast<unsigned char>(random.below(16));
  return image;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() &&
         std::equal(a.data, a.data + a.total() * a.elemSize(), b.data);
}

/// Runs a program text of python3 with zarr; the exit code, or nothing where there is none.
std::optional<int> python(const std::string& program, const fs::path& folder) {
  constexpr const char* kPython = "/usr/bin/python3";
  if (std::system((std::string(kPython) + " -c 'import zarr' 2> /dev/null").c_str()) != 0)
    return std::nullopt;
  const fs::path file = folder.parent_path() / "program.py";
  std::ofstream(file) << program;
  return WEXITSTATUS(
      std::system((std::string(kPython) + " " + file.string() + " " + folder.string()).c_str()));
}

TEST_F(RecordingFolder, MetadataThatCannotBeMeantIsRefused) {
  RecordingWriter writer(folder_, {{"cam0", 4, 3, 1, 8, 0}}, {});
  writer.write(0, 0, cv::Mat::zeros(3, 4, CV_8U), 0);
  writer.close();
  const auto change = [&](const char* file, const char* key, const nlohmann::json& value) {
    nlohmann::ordered_json object = read_json(folder_ / file);
    object[key] = value;
    write_json(folder_ / file, object);
    return error_of([&] { static_cast<void>(Recording::open(folder_)); });
  };
  EXPECT_THAT(change(".zattrs", "is_open", "yes"), ::testing::HasSubstr("must be true or false"));
  EXPECT_EQ(change(".zattrs", "is_open", false), "");
  // The tables of so many frames would take a gigabyte that no file justifies.
  EXPECT_THAT(change("cam0/.zarray", "shape", {100'000'000, 3, 4}),
              ::testing::HasSubstr("must have at most 10000000 frames"));
}

// The tables of times are read whole, in so many chunks at most (io/zarr_array.cpp).
TEST_F(RecordingFolder, TheLongestRecordingOfTheMostCamerasCanBeRead) {
  constexpr std::int64_t kMostChunks = 1'000'000;
  constexpr std::int64_t kMostFrames = 10'000'000;
  constexpr std::int64_t kCameras = 256;  // of a rig
  RecordingWriter writer(folder_, {{"cam0", 1, 1, 1, 8, 0}});
  writer.write(0, 0, cv::Mat::zeros(1, 1, CV_8U), 0);
  writer.close();
  for (const char* table : {"timestamp_ns", "valid"}) {
    const auto rows = read_json(folder_ / table / ".zarray").at("chunks").at(0).get<std::int64_t>();
    EXPECT_EQ(read_json(folder_ / table / ".zarray").at("chunks").at(1), 1);
    EXPECT_LE((kMostFrames + rows - 1) / rows * kCameras, kMostChunks) << table;
  }
}

// A row beyond it could be written and not be read.
TEST_F(RecordingFolder, MoreFramesThanCanBeReadAreRefused) {
  RecordingWriter writer(folder_, {{"cam0", 1, 1, 1, 8, 0}});
  const cv::Mat pixel = cv::Mat::zeros(1, 1, CV_8U);
  writer.write(0, 0, pixel, 0);
  EXPECT_THROW(writer.write(10'000'000, 0, pixel, 0), StageError);
  EXPECT_THROW(writer.write_missing(10'000'000, 0, 0), StageError);
  writer.close();
  EXPECT_EQ(Recording::open(folder_).row_count(), 1U);
}

TEST_F(RecordingFolder, GivesBackWhatWasWritten) {
  const std::vector<RecordedCamera> cameras = three_kinds();
  for (const auto compression :
       {ZarrCompression::kNone, ZarrCompression::kLz4, ZarrCompression::kZstd}) {
    fs::remove_all(folder_);
    RecordingOptions options;
    options.compression = compression;
    options.attributes["place"] = "laboratory";
    RecordingWriter writer(folder_, cameras, options);
    for (const std::size_t row : {2U, 0U, 70U}) {
      for (std::size_t c = 0; c < cameras.size(); ++c)
        writer.write(row, c, picture(cameras[c], row), static_cast<std::int64_t>(1000 * row + c));
    }
    writer.write_missing(71, 1, 71001);
    writer.close();

    const Recording recording = Recording::open(folder_);
    ASSERT_EQ(recording.row_count(), 72U);
    EXPECT_TRUE(recording.is_closed());
    EXPECT_EQ(recording.attributes().at("place"), "laboratory");
    ASSERT_EQ(recording.cameras().size(), 3U);
    EXPECT_EQ(recording.cameras()[1].exposure_us, 4000);
    for (std::size_t row = 0; row < 72; ++row) {
      const bool written = row == 0 || row == 2 || row == 70;
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        EXPECT_EQ(recording.valid(row, c), written);
        const cv::Mat read = recording.read(row, c);
        if (written)
          EXPECT_TRUE(same(read, picture(cameras[c], row)));
        else
          EXPECT_TRUE(read.empty());
      }
    }
    EXPECT_EQ(recording.timestamp_ns(70, 2), 70002);
    EXPECT_EQ(recording.timestamp_ns(71, 1), 71001);
    EXPECT_EQ(recording.timestamp_ns(1, 0), kUnknownTime);
  }
}

TEST_F(RecordingFolder, AMissingChunkIsNoPictureAndADamagedOneIsNamed) {
  const RecordedCamera camera{"cam0", 30, 20, 1, 8, 0};
  RecordingWriter writer(folder_, {camera});
  for (std::size_t row = 0; row < 3; ++row) writer.write(row, 0, picture(camera, row), 0);
  writer.close();
  fs::remove(folder_ / "cam0" / "0.0.0");
  fs::resize_file(folder_ / "cam0" / "1.0.0", 100);
  const Recording recording = Recording::open(folder_);
  EXPECT_TRUE(recording.valid(0, 0));
  EXPECT_TRUE(recording.read(0, 0).empty());
  EXPECT_THAT(
      error_of([&] { (void)recording.read(1, 0); }),
      ::testing::AllOf(::testing::HasSubstr("cam0/1.0.0"), ::testing::HasSubstr("damaged")));
  EXPECT_FALSE(recording.read(2, 0).empty());
}

TEST_F(RecordingFolder, OneThreadPerCameraGivesTheSameBytes) {
  const std::vector<RecordedCamera> cameras = three_kinds();
  const fs::path other = temporary_.path() / "other.zarr";
  constexpr std::size_t kRows = 150;
  const auto fill = [&](RecordingWriter& writer, std::size_t c) {
    for (std::size_t row = 0; row < kRows; ++row)
      writer.write(row, c, picture(cameras[c], row), static_cast<std::int64_t>(row));
  };
  {
    RecordingWriter writer(folder_, cameras);
    std::vector<std::thread> threads;
    for (std::size_t c = 0; c < cameras.size(); ++c)
      threads.emplace_back(fill, std::ref(writer), c);
    for (std::thread& thread : threads) thread.join();
    writer.close();
    RecordingWriter alone(other, cameras);
    for (std::size_t c = 0; c < cameras.size(); ++c) fill(alone, c);
    alone.close();
  }
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(other)) {
    if (!entry.is_regular_file()) continue;
    ++files;
    EXPECT_EQ(read_file(entry.path()), read_file(folder_ / fs::relative(entry.path(), other)));
  }
  EXPECT_GT(files, kRows * cameras.size());
}

TEST_F(RecordingFolder, WhatWasWrittenOutlivesAKilledWriter) {
  const RecordedCamera camera{"cam0", 64, 48, 1, 8, 0};
  Random random(7);
  for (int trial = 0; trial < 5; ++trial) {
    fs::remove_all(folder_);
    int pipe_ends[2];
    ASSERT_EQ(::pipe(pipe_ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      RecordingWriter writer(folder_, {camera});
      for (std::size_t row = 0;; ++row) {
        writer.write(row, 0, picture(camera, row), static_cast<std::int64_t>(row));
        if (::write(pipe_ends[1], "x", 1) != 1) ::_exit(1);
      }
    }
    ::close(pipe_ends[1]);
    const std::size_t least = 1 + random.below(200);
    std::size_t written = 0;
    char byte = 0;
    while (written < least && ::read(pipe_ends[0], &byte, 1) == 1) ++written;
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    while (::read(pipe_ends[0], &byte, 1) == 1) ++written;
    ::close(pipe_ends[0]);

    const Recording recording = Recording::open(folder_);
    EXPECT_FALSE(recording.is_closed());
    EXPECT_GE(recording.row_count(), written);
    EXPECT_LE(recording.row_count(), written + 1);
    for (std::size_t row = 0; row < recording.row_count(); ++row)
      EXPECT_TRUE(same(recording.read(row, 0), picture(camera, row))) << row;
  }
}

TEST_F(RecordingFolder, AWriterKilledWhileItsArraysGrowLeavesWhatWasWritten) {
  const std::vector<RecordedCamera> cameras = three_kinds();
  {
    RecordingWriter writer(folder_, cameras);
    for (std::size_t c = 0; c < cameras.size(); ++c) writer.write(5, c, picture(cameras[c], 5), 50);
  }
  // Arrays grow one after another, in this order.
  for (const char* array : {"cam0", "cam1", "cam2", "timestamp_ns", "valid"}) {
    nlohmann::ordered_json object = read_json(folder_ / array / ".zarray");
    object["shape"][0] = 2 * object["shape"][0].get<int>();
    write_json(folder_ / array / ".zarray", object);
    const Recording recording = Recording::open(folder_);
    EXPECT_FALSE(recording.is_closed());
    ASSERT_EQ(recording.row_count(), 6U) << array;
    EXPECT_EQ(recording.timestamp_ns(5, 2), 50);
    EXPECT_TRUE(same(recording.read(5, 1), picture(cameras[1], 5)));
  }
  nlohmann::ordered_json object = read_json(folder_ / "cam1" / ".zarray");
  object["shape"][0] = 7;
  write_json(folder_ / "cam1" / ".zarray", object);
  EXPECT_EQ(Recording::open(folder_).row_count(), 6U);
  nlohmann::ordered_json closed = read_json(folder_ / ".zattrs");
  closed["is_open"] = false;
  write_json(folder_ / ".zattrs", closed);
  EXPECT_THAT(error_of([&] { (void)Recording::open(folder_); }),
              ::testing::HasSubstr("must have as many frames"));
}

TEST_F(RecordingFolder, PythonReadsIt) {
  const std::vector<RecordedCamera> cameras = {{"cam0", 5, 4, 1, 8, 0}, {"cam1", 5, 4, 3, 16, 0}};
  RecordingWriter writer(folder_, cameras);
  cv::Mat grey(4, 5, CV_8UC1);
  cv::Mat color(4, 5, CV_16UC3);
  for (int i = 0; i < 20; ++i) grey.data[i] = static_cast<unsigned char>(3 * i);
  for (int i = 0; i < 60; ++i) color.ptr<std::uint16_t>()[i] = static_cast<std::uint16_t>(1000 * i);
  writer.write(1, 0, grey, 11);
  writer.write(1, 1, color, 12);
  writer.close();
  const auto code = python(R"(
import sys, numpy, zarr
group = zarr.open(sys.argv[1], mode="r")
assert group.attrs["cameras"] == ["cam0", "cam1"]
assert group["cam0"].shape == (2, 4, 5) and group["cam1"].shape == (2, 4, 5, 3)
assert (group["cam0"][1].ravel() == 3 * numpy.arange(20)).all()
assert (group["cam1"][1].ravel() == 1000 * numpy.arange(60)).all()
assert group["timestamp_ns"][:].tolist() == [[-1, -1], [11, 12]]
assert group["valid"][:].tolist() == [[0, 0], [1, 1]]
)",
                           folder_);
  if (!code) GTEST_SKIP() << "python3-zarr is not installed";
  EXPECT_EQ(*code, 0);
}

TEST_F(RecordingFolder, ReadsWhatPythonWrites) {
  const auto code = python(R"(
import sys, numpy, zarr
from numcodecs import Blosc
group = zarr.open_group(sys.argv[1], mode="w")
group.attrs["cameras"] = ["left", "right"]
values = (numpy.arange(3 * 4 * 5) * 4).reshape(3, 4, 5)
for name, codec, separator in (("left", Blosc("zstd", 3, Blosc.SHUFFLE), "."), ("right", None, "/")):
    array = group.create_dataset(name, shape=(3, 4, 5), chunks=(1, 4, 5), dtype="u1",
                                 compressor=codec, dimension_separator=separator)
    array[:] = values
group.create_dataset("timestamp_ns", data=numpy.arange(6, dtype="i8").reshape(3, 2) * 10**12)
group.create_dataset("valid", data=numpy.array([[1, 1], [1, 0], [1, 1]], dtype="u1"))
)",
                           folder_);
  if (!code) GTEST_SKIP() << "python3-zarr is not installed";
  ASSERT_EQ(*code, 0);
  const Recording recording = Recording::open(folder_);
  ASSERT_EQ(recording.row_count(), 3U);
  EXPECT_TRUE(recording.is_closed());
  EXPECT_EQ(recording.timestamp_ns(2, 1), 5'000'000'000'000);
  EXPECT_TRUE(recording.read(1, 1).empty());
  for (const auto& [row, camera] : {std::pair{0, 0}, {2, 0}, {0, 1}, {2, 1}}) {
    const cv::Mat image = recording.read(std::size_t(row), std::size_t(camera));
    ASSERT_EQ(image.total(), 20U);
    for (int i = 0; i < 20; ++i) EXPECT_EQ(image.data[i], (4 * (20 * row + i)) % 256);
  }
}

TEST_F(RecordingFolder, WhatBreaksTheFormatIsNamedByFileFieldAndRule) {
  const RecordedCamera camera{"cam0", 30, 20, 1, 8, 0};
  const auto with = [&](const fs::path& file, const std::string& from, const std::string& to) {
    fs::remove_all(folder_);
    RecordingWriter writer(folder_, {camera});
    writer.write(0, 0, picture(camera, 0), 0);
    writer.close();
    std::string text = read_file(folder_ / file);
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << text;
    text.replace(at, from.size(), to);
    std::ofstream(folder_ / file) << text;
    return error_of([&] { (void)Recording::open(folder_); });
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(with("cam0/.zarray", "\"|u1\"", "\"<f8\""), HasSubstr("cam0/.zarray: dtype"));
  EXPECT_THAT(with("cam0/.zarray", "\"blosc\"", "\"zlib\""), HasSubstr("compressor"));
  EXPECT_THAT(with("cam0/.zarray", "\"C\"", "\"F\""), HasSubstr("order"));
  EXPECT_THAT(with("cam0/.zarray", "\"zarr_format\": 2", "\"zarr_format\": 3"),
              HasSubstr("must be 2"));
  EXPECT_THAT(with("valid/.zarray", "\"|u1\"", "\"<i8\""), HasSubstr("valid/.zarray: dtype"));
  EXPECT_THAT(with(".zattrs", "\"cam0\"", "\"../cam0\""), HasSubstr("cameras"));
  EXPECT_THAT(with(".zattrs", "\"cam0\"", "\"cam1\""), HasSubstr("cam1/.zarray"));
  EXPECT_THAT(error_of([&] { RecordingWriter(folder_, {camera}); }), HasSubstr("must be new"));
}

}  // namespace
}  // namespace pencilscan
