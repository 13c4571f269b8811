#pragma once

namespace stepdriver::ros_node {

/// Memory for an orderly end. If the process has no other memory left, the reserve is released, and
/// SIGTERM asks the node to end: it decelerates and disables its axes. There is one object, for as
/// long as the node runs.
class MemoryReserve {
 public:
  MemoryReserve();

  /// Whether it was released.
  static bool isUsed();
};

}  // namespace stepdriver::ros_node
