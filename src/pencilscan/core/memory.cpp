#include "pencilscan/core/memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
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
