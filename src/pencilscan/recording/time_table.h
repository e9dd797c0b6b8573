#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pencilscan/recording/frame_folders.h"

namespace pencilscan {

/// Time stamps by frame name and camera, ns.
using TimeTable = std::map<std::string, std::map<std::string, std::int64_t>>;

/// Reads timestamps.csv: frame, then a column per camera; empty cells are unknown times. InputError
/// for columns of no camera of `cameras`, for rows and columns that stand twice, and for times that
/// are no whole numbers of 64 bits.
[[nodiscard]] TimeTable read_time_table(const std::filesystem::path& file,
                                        const std::vector<std::string>& cameras);

/// kUnknownTime where it is not there.
[[nodiscard]] std::int64_t time_of(const TimeTable& times, const std::string& frame,
                                   const std::string& camera);

/// Warns of time stamps and pictures without the other. InputError where no row is of a frame.
[[nodiscard]] std::vector<std::string> unmatched_times(const std::filesystem::path& file,
                                                       const TimeTable& times,
                                                       const FoundFrames& found);

}  // namespace pencilscan
