#include "pencilscan/api/version.h"

namespace pencilscan {

const char* version() { return PENCILSCAN_VERSION; }

}  // namespace pencilscan
