#include "pencilscan/core/memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <string>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace pencilscan {
namespace {

/// The value of a line "name: value kB" of a file in /proc, bytes; nothing where it is not there.
double proc_bytes(const char* file, const std::string& name) {
  std::ifstream in(file);
  std::string word;
  double kilobytes = 0;
  while (in >> word) {
    if (word == name && in >> kilobytes) return 1024 * kilobytes;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

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
  return available;
}

}  // namespace pencilscan
