#include "pencilscan/core/memory.h"

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace pencilscan {

void keep_freed_memory() {
#ifdef __GLIBC__
  constexpr int kMostForMmap = 32 << 20;  // what 64-bit glibc accepts; any image of a camera
  constexpr int kKept = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, kMostForMmap);
  mallopt(M_TRIM_THRESHOLD, kKept);
#endif
}

}  // namespace pencilscan
