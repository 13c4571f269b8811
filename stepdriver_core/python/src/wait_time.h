#pragma once

#include <chrono>
#include <optional>

namespace stepdriver::python {

/// How long to wait. A number of seconds that the clocks can't count is as long as it takes.
inline std::chrono::nanoseconds waitTimeOf(std::optional<double> seconds) {
  using std::chrono::nanoseconds;
  if (!seconds) return nanoseconds::max();
  const double count = *seconds * 1e9;
  if (!(count < static_cast<double>(nanoseconds::max().count()))) return nanoseconds::max();
  return count > 0.0 ? nanoseconds(static_cast<nanoseconds::rep>(count)) : nanoseconds::zero();
}

}  // namespace stepdriver::python
