#pragma once

#include <httplib.h>

// It includes <resolv.h>, whose macro takes a name that Eigen uses.
#undef _res
