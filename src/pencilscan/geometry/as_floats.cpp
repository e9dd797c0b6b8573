#include "pencilscan/geometry/as_floats.h"

namespace pencilscan {

[[gnu::noipa]] Eigen::Vector3f to_floats(const Vec3& x) { return x.cast<float>(); }

}  // namespace pencilscan
