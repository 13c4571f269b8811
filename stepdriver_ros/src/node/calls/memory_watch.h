#pragma once

#include <chrono>
#include <cstddef>

#include "common/descriptor.h"

namespace stepdriver::ros_node {

/// Gives memory back to the system that a flood of calls or long messages has taken and freed. The
/// C library keeps what lies between pieces that are still in use.
class MemoryWatch {
 public:
  /// Create it when the process has everything that it needs at rest.
  MemoryWatch();

  /// Call it from one thread, about once a second. It acts only if the process has more memory than
  /// before and takes no more, and less and less often while that changes nothing.
  void look();

 private:
  using Clock = std::chrono::steady_clock;

  std::size_t residentPages() const;

  const Descriptor statm_;
  std::size_t least_;  ///< [pages] that were enough
  std::size_t last_;   ///< [pages] at the last look
  std::chrono::seconds pause_;
  Clock::time_point next_;
};

}  // namespace stepdriver::ros_node
