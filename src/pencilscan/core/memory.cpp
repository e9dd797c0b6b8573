#include "pencilscan/core/memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace pencilscan {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// The value of a line "name: value kB" of a file in /proc, bytes; nothing where it is not there.
double proc_bytes(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string word;
  double kilobytes = 0;
  while (in >> word) {
    if (word == name && in >> kilobytes) return 1024 * kilobytes;
  }
  return kNoLimit;
}

/// What the files of one version of control groups are called.
struct GroupFiles {
  const char* limit;
  const char* usage;
  std::array<const char*, 3> reclaimable;  ///< in memory.stat, of the group and those below it
};
constexpr GroupFiles kSecondVersion = {
    "memory.max", "memory.current", {"inactive_file", "active_file", "slab_reclaimable"}};
constexpr GroupFiles kFirstVersion = {"memory.limit_in_bytes",
                                      "memory.usage_in_bytes",
                                      {"total_inactive_file", "total_active_file", ""}};

/// The number that a file of a control group holds; infinity where it is "max", not a size, or not
/// to be read.
double group_bytes(const std::filesystem::path& file) {
  constexpr double kAbsurd = 0x1p60;  // version 1 writes nearly 2^63 for no limit
  std::ifstream in(file);
  double bytes = 0;
  return in >> bytes && bytes >= 0 && bytes < kAbsurd ? bytes : kNoLimit;
}

/// Bytes that a group counts as used and that the system takes back where they are needed: copies
/// of files, as MemAvailable counts them.
double reclaimable_bytes(const std::filesystem::path& folder,
                         const std::array<const char*, 3>& names) {
  std::ifstream in(folder / "memory.stat");
  std::string word;
  double bytes = 0;
  double all = 0;
  while (in >> word >> bytes) {
    if (std::find(names.begin(), names.end(), word) != names.end()) all += std::max(0.0, bytes);
  }
  return all;
}

/// What one group leaves; infinity where it has no limit.
double left_in_group(const std::filesystem::path& folder, const GroupFiles& files) {
  const double limit = group_bytes(folder / files.limit);
  const double used = group_bytes(folder / files.usage);
  if (limit == kNoLimit || used == kNoLimit) return kNoLimit;
  return std::clamp(limit - used + reclaimable_bytes(folder, files.reclaimable), 0.0, limit);
}

/// The least that a group and those above it leave, up to `mount`. A container often sees its own
/// group there, and the path of the group on its host, which it does not have.
double left_up_to(const std::filesystem::path& mount, const std::filesystem::path& group,
                  const GroupFiles& files) {
  double left = left_in_group(mount, files);
  std::filesystem::path folder = mount;
  for (const auto& name : group.relative_path()) {
    folder /= name;
    left = std::min(left, left_in_group(folder, files));
  }
  return left;
}

}  // namespace

double memory_of_groups(const std::string& groups, const std::filesystem::path& mount) {
  double left = kNoLimit;
  std::istringstream lines(groups);
  for (std::string line; std::getline(lines, line);) {  // number:controllers:path
    const auto first = line.find(':');
    const auto second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const std::filesystem::path group = line.substr(second + 1);
    if (controllers.empty())
      left = std::min(left, left_up_to(mount, group, kSecondVersion));
    else if (("," + controllers + ",").find(",memory,") != std::string::npos)
      left = std::min(left, left_up_to(mount / "memory", group, kFirstVersion));
  }
  return left;
}

void keep_freed_memory() {
#ifdef __GLIBC__
  constexpr int kMostForMmap = 32 << 20;  // what 64-bit glibc accepts; any image of a camera
  constexpr int kKept = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, kMostForMmap);
  mallopt(M_TRIM_THRESHOLD, kKept);
#endif
}

double available_memory() {
  double available = proc_bytes("/proc/meminfo", "MemAvailable:");
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    const double taken = proc_bytes("/proc/self/status", "VmSize:");
    available = std::min(available, std::max(0.0, static_cast<double>(limit.rlim_cur) - taken));
  }
  std::ifstream groups("/proc/self/cgroup");
  std::ostringstream text;
  text << groups.rdbuf();
  return std::min(available, memory_of_groups(text.str(), "/sys/fs/cgroup"));
}

bool is_of_memory(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) return true;
  if (const auto* system = dynamic_cast<const std::system_error*>(&error)) {
    return system->code() == std::errc::not_enough_memory ||
           system->code() == std::errc::resource_unavailable_try_again;
  }
  // OpenCV's way, and oneTBB's where the system refuses a thread.
  const std::string_view text = error.what();
  return text.find("Insufficient memory") != std::string_view::npos ||
         text.find("Resource temporarily unavailable") != std::string_view::npos;
}

std::string in_plain_words(const std::exception& error) {
  return is_of_memory(error) ? "there is not enough memory for images or results of this size"
                             : error.what();
}

}  // namespace pencilscan
