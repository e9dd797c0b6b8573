#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <new>
#include <nlohmann/json.hpp>

#include "pencilscan/io/file.h"
#include "pencilscan/io/folder_lock.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/io_fixture.h"
#include "pencilscan/io/json_text.h"
#include "pencilscan/io/partial_folder.h"
#include "pencilscan/io/zarr_array.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

TEST_F(Io, AtomicWriteReplacesAndLeavesNoTemporary) {
  write_text(folder_ / "deep/er/a.txt", "one");
  write_text(folder_ / "deep/er/a.txt", "two");
  EXPECT_EQ(read_file(folder_ / "deep/er/a.txt"), "two");
  folder_ /= "deep/er";
  EXPECT_EQ(file_count(), 1U);
  folder_ = folder_.parent_path().parent_path();
}

TEST_F(Io, AtomicWriteKeepsTheOldFileWhenTheWriterThrows) {
  write_text(folder_ / "a.txt", "old");
  EXPECT_THROW(write_atomically(folder_ / "a.txt",
                                [](std::ostream& stream) {
                                  stream << std::string(1 << 20, 'x');
                                  throw StageError("no");
                                }),
               StageError);
  EXPECT_EQ(read_file(folder_ / "a.txt"), "old");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, AFileInTheMakingHasNoNameThatAKilledProgramCouldLeave) {
  const int unnamed = ::open(folder_.c_str(), O_WRONLY | O_TMPFILE, 0600);
  if (unnamed < 0) GTEST_SKIP() << "this file system has no files without names";
  ::close(unnamed);
  write_atomically(folder_ / "a.txt", [&](std::ostream& stream) {
    stream << std::string(1 << 20, 'x');
    EXPECT_EQ(file_count(), 0U);
  });
  EXPECT_EQ(fs::file_size(folder_ / "a.txt"), std::uintmax_t{1} << 20);
}

/// Files of killed programs that had the number of this process.
void leave_parts_of(const fs::path& target) {
  constexpr int kMoreThanTestsWrite = 300;
  for (int i = 0; i < kMoreThanTestsWrite; ++i)
    std::ofstream(target.string() + ".part" + std::to_string(::getpid()) + "_" + std::to_string(i));
}

TEST_F(Io, WhatAKilledProgramLeftIsInNobodysWay) {
  const fs::path path = put("a.txt", "old");
  leave_parts_of(path);
  const std::size_t before = file_count();
  write_text(path, "new");
  EXPECT_EQ(read_file(path), "new");
  EXPECT_EQ(file_count(), before);
}

TEST_F(Io, WhatAKilledProgramLeftIsInNobodysWayWhereEachFileHasAName) {
  const fs::path path = folder_ / "a.txt";
  const pid_t child = ::fork();
  if (child == 0) {
    leave_parts_of(path);
    // Without /proc a file cannot get its name late.
    if (::chroot(folder_.c_str()) != 0) ::_exit(2);
    try {
      write_text("/a.txt", "new");
    } catch (const StageError&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 2) GTEST_SKIP() << "only root can take /proc away";
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(read_file(path), "new");
}

TEST_F(Io, AFolderIsLockedByOneAtATime) {
  const fs::path folder = folder_ / "locked";
  fs::create_directories(folder);
  FolderLock first(folder);
  ASSERT_TRUE(first.is_held());
  EXPECT_FALSE(first.is_taken());
  EXPECT_TRUE(FolderLock(folder).is_taken());
  EXPECT_FALSE(FolderLock(folder).is_held());
  FolderLock second = std::move(first);
  EXPECT_TRUE(second.is_held());
  EXPECT_TRUE(FolderLock(folder).is_taken());
  second.release();
  EXPECT_TRUE(FolderLock(folder).is_held());
  fs::remove(folder);
  const FolderLock gone(folder);
  EXPECT_TRUE(gone.is_taken());
  EXPECT_EQ(gone.error(), ENOENT);
}

TEST_F(Io, APartialFolderStartsEmptyAndLeavesNothing) {
  const fs::path path = folder_ / "film.partial";
  write_text(path / "old.txt", "of a killed program");
  {
    const PartialFolder making(path);
    EXPECT_FALSE(fs::exists(path));
    write_text(making.path() / "new.txt", "whole");
    fs::rename(making.path() / "new.txt", folder_ / "new.txt");
  }
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, WhatAKilledProgramWasReplacingIsPutBack) {
  const auto target = folder_ / "film";
  write_text(folder_ / "film.partial" / "old" / "frame", "before");
  write_text(folder_ / "film.partial" / "new" / "frame", "half");
  {
    const ReplacingFolder making(target);
    EXPECT_EQ(read_file(target / "frame"), "before");
    EXPECT_FALSE(std::filesystem::exists(making.path()));
    EXPECT_NE(error_of([&] { return ReplacingFolder(target).path(); }), "");
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "film.partial"));
  // A link stays one.
  std::filesystem::create_directory_symlink(target, folder_ / "link");
  {
    ReplacingFolder making(folder_ / "link");
    write_text(making.path() / "frame", "after");
    making.publish();
  }
  EXPECT_EQ(read_file(target / "frame"), "after");
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link"));
}

TEST_F(Io, AFolderTakesAnothersPlaceWhenItIsWhole) {
  const fs::path target = folder_ / "film";
  write_text(target / "old.txt", "old");
  {
    const ReplacingFolder making(target / "");
    write_text(making.path() / "new.txt", "half");
  }
  EXPECT_TRUE(fs::exists(target / "old.txt"));
  {
    ReplacingFolder making(target / "");
    write_text(making.path() / "new.txt", "whole");
    making.publish();
  }
  EXPECT_EQ(read_file(target / "new.txt"), "whole");
  EXPECT_FALSE(fs::exists(target / "old.txt"));
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, NamesCanStandBesideABareFolder) {
  EXPECT_EQ(bare_folder("a/film/"), "a/film");
  EXPECT_EQ(bare_folder("a/./film/."), "a/film");
  EXPECT_EQ(bare_folder("film"), "film");
  EXPECT_EQ(bare_folder("."), fs::current_path());
  EXPECT_EQ(bare_folder("./"), fs::current_path());
  EXPECT_EQ(bare_folder(".."), fs::current_path().parent_path());
}

TEST_F(Io, WhatCannotBeReplacedIsAStageErrorAndLeavesNoTemporary) {
  fs::create_directories(folder_ / "taken" / "x");
  EXPECT_THROW(write_text(folder_ / "taken", "text"), StageError);
  EXPECT_THROW(write_text("/proc/none/a.txt", "text"), StageError);
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, AFullDiskIsAStageErrorAndKeepsTheOldFile) {
  write_text(folder_ / "a.png", "old");
  // A file size limit stands in for the full disk: write() fails half-way in the same manner.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{10000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  std::string message;
  try {
    write_text(folder_ / "a.png", std::string(100000, 'x'));
  } catch (const StageError& error) {
    message = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_THAT(message, ::testing::HasSubstr("a.png: cannot be written"));
  EXPECT_EQ(read_file(folder_ / "a.png"), "old");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Io, LackOfMemoryIsNotTheEndOfAFile) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer itself takes more memory than the limit of this test";
#endif
  const fs::path path = put("large.bin", "");
  fs::resize_file(path, std::uintmax_t{1} << 28);
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  const rlimit little{pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + (100U << 20),
                      before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_AS, &little), 0);
  EXPECT_THROW((void)read_file(path), std::bad_alloc);
  setrlimit(RLIMIT_AS, &before);
  EXPECT_EQ(read_file(path).size(), std::size_t{1} << 28);
}

TEST_F(Io, JsonErrorsNameTheFileAndThePlace) {
  const auto path = put("a.json", "{\"a\": NaN}");
  const std::string message = error_of([&] { return read_json(path); });
  EXPECT_THAT(message, ::testing::HasSubstr("a.json"));
  EXPECT_THAT(message, ::testing::HasSubstr("line 1"));
  EXPECT_THAT(error_of([&] { return read_json(put("b.json", "{\"k\": 1, \"k\": 2}")); }),
              ::testing::HasSubstr("k: this key must not stand twice"));
  EXPECT_THAT(error_of([&] { return read_json(put("c.json", "{\"a\": 1, \"t\": [0, 1e999]}")); }),
              ::testing::HasSubstr("t: must be finite"));
  EXPECT_THAT(error_of([&] { return read_json(folder_ / "none.json"); }),
              ::testing::HasSubstr("does not exist"));
  EXPECT_THAT(error_of([&] { return read_json(put("c.json", "")); }),
              ::testing::HasSubstr("c.json"));
}

TEST_F(Io, NamesInLatin1DoNotKeepJsonFromBeingWritten) {
  const fs::path path = folder_ / "f\xfcr.json";
  write_json(path, {{"folder", path.filename().string()}});
  EXPECT_EQ(read_json(path).at("folder"), "f\xef\xbf\xbdr.json");  // U+FFFD
  EXPECT_EQ(json_line({{"a", "\xe9"}}), "{\"a\":\"\xef\xbf\xbd\"}");
  EXPECT_TRUE(is_utf8("f\xc3\xbcr"));
  EXPECT_FALSE(is_utf8("f\xfcr"));
}

TEST_F(Io, HoldingsNameFilesBeforeFolders) {
  EXPECT_EQ(holdings(folder_), "it is empty");
  std::filesystem::create_directories(folder_ / "b");
  EXPECT_EQ(holdings(folder_), "it holds only folders: b");
  for (int i = 0; i < 7; ++i) put("IMG_" + std::to_string(i), "x");
  put(".hidden", "x");
  EXPECT_EQ(holdings(folder_), "it holds IMG_0, IMG_1, IMG_2, IMG_3 and 3 more");
}

TEST_F(Io, WhatCannotBeReachedIsNotCalledAbsent) {
  const fs::path priv = folder_ / "priv";
  fs::create_directories(priv);
  put("priv/rig.json", "{}");
  fs::permissions(priv, ::geteuid() == 0 ? fs::perms::owner_all : fs::perms::none);
  {
    const BoundUser user;
    if (::access(priv.c_str(), R_OK) == 0) GTEST_SKIP() << "permissions do not bind this user";
    EXPECT_THAT(error_of([&] { return read_json(priv / "rig.json"); }),
                ::testing::HasSubstr("priv/rig.json: cannot be opened: Permission denied"));
    EXPECT_EQ(holdings(priv), "it cannot be listed: Permission denied");
  }
  fs::permissions(priv, fs::perms::owner_all);
  fs::create_symlink("loop", folder_ / "loop");
  EXPECT_THAT(error_of([&] { return read_file(folder_ / "loop"); }),
              ::testing::HasSubstr("loop: cannot be opened: Too many levels of symbolic links"));
  EXPECT_EQ(holdings(folder_ / "loop"), "it cannot be listed: Too many levels of symbolic links");
  EXPECT_THAT(error_of([&] { return read_file(folder_ / std::string(300, 'x')); }),
              ::testing::HasSubstr("cannot be opened: File name too long"));
  EXPECT_THAT(error_of([&] { return read_file(folder_ / "priv/rig.json/x"); }),
              ::testing::HasSubstr("the file does not exist"));
}

TEST_F(Io, JsonThatIsNestedTooDeepIsRefused) {
  const auto nested = [](int levels) {
    return std::string(static_cast<std::size_t>(levels), '[') +
           std::string(static_cast<std::size_t>(levels), ']');
  };
  EXPECT_EQ(error_of([&] { return read_json(put("a.json", nested(150))); }), "");
  for (const int levels : {300, 1'000'000})
    EXPECT_THAT(error_of([&] { return read_json(put("a.json", nested(levels))); }),
                ::testing::HasSubstr("must not be nested deeper than 200 levels"));
}

/// Metadata of a Zarr array that is good but for one value.
std::string zarr_metadata(const std::string& key, const std::string& value) {
  nlohmann::ordered_json object = {{"zarr_format", 2},      {"shape", {2, 3}}, {"chunks", {2, 3}},
                                   {"dtype", "|u1"},        {"order", "C"},    {"filters", nullptr},
                                   {"compressor", nullptr}, {"fill_value", 0}};
  object[key] = nlohmann::ordered_json::parse(value);
  return object.dump();
}

TEST_F(Io, ZarrTakesNoMemoryThatItsFilesDoNotJustify) {
  put(".zarray", zarr_metadata("shape", "[2, 3]"));
  put("0.0", "abcdef");
  EXPECT_EQ(read_zarr_bytes(folder_, read_zarr_array(folder_)).size(), 6U);
  // 16 GB by the metadata, 6 bytes in the file, raw or compressed.
  put(".zarray", zarr_metadata("chunks", "[46340, 46340]"));
  const std::int64_t first[] = {0, 0};
  for (const ZarrCompression compression : {ZarrCompression::kNone, ZarrCompression::kZstd}) {
    ZarrArray array = read_zarr_array(folder_);
    array.type = ZarrType::kInt64;
    array.compression = compression;
    EXPECT_THAT(error_of([&] { return read_zarr_chunk(folder_, array, first).has_value(); }),
                ::testing::HasSubstr("it is damaged or of another size"));
  }
  // A file for each element: looking for them would take minutes.
  put(".zarray", R"({"zarr_format": 2, "shape": [40000, 40000], "chunks": [1, 1], "dtype": "|u1",
                     "order": "C", "filters": null, "compressor": null, "fill_value": 0})");
  EXPECT_THAT(error_of([&] { return read_zarr_bytes(folder_, read_zarr_array(folder_)).size(); }),
              ::testing::HasSubstr("must be at most 1,000,000 in all"));
}

TEST_F(Io, ZarrFillsWithValuesOfItsTypeOnly) {
  for (const char* value : {"256", "-1", "1e300", "\"NaN\""}) {
    put(".zarray", zarr_metadata("fill_value", value));
    EXPECT_THAT(error_of([&] { return read_zarr_array(folder_).fill_value; }),
                ::testing::HasSubstr("must be a value of dtype"))
        << value;
  }
  put(".zarray", zarr_metadata("fill_value", "null"));
  EXPECT_EQ(read_zarr_array(folder_).fill_value, 0);
}

}  // namespace
}  // namespace pencilscan
