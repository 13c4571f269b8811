#pragma once

#include <functional>

#include "motion/double_double.h"

namespace stepdriver::motion {

/// The root of a continuous function that falls from above 0 at 0 to 0 or less at `high`, to more
/// bits than a double has.
///
/// Ridders' method (C. J. F. Ridders, A new algorithm for computing a single root of a real
/// continuous function, 1979), which never leaves its bracket; then secants in double-double.
DoubleDouble rootOf(const std::function<DoubleDouble(DoubleDouble)>& f, double high);

}  // namespace stepdriver::motion
