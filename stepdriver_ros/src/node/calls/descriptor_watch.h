#pragma once

#include <dirent.h>

#include <atomic>
#include <cstddef>
#include <vector>

namespace stepdriver::ros_node {

/// Watches how many file descriptors the process has left. roscpp accepts each connection and keeps
/// it for ever, also if its client never says a word. With no descriptor left it accepts nobody,
/// and keeps a processor busy trying.
class DescriptorWatch {
 public:
  /// Raises the process's limit as far as it may.
  DescriptorWatch();
  ~DescriptorWatch();
  DescriptorWatch(const DescriptorWatch&) = delete;
  DescriptorWatch& operator=(const DescriptorWatch&) = delete;

  /// Counts. If few are left, it ends connections to roscpp's sockets: those whose client has never
  /// sent anything, and then those on which nothing was sent either way for a minute. Call it from
  /// one thread, about each second, once roscpp has started.
  void look();

  struct Figures {
    std::size_t open = 0;
    std::size_t limit = 0;
    std::size_t ended = 0;  ///< connections, since the start
    bool few_left = false;
  };
  /// Of the last look. Any thread.
  Figures figures() const;

 private:
  std::vector<int> openOnes();
  std::size_t endIdle(const std::vector<int>& open) const;

  // Held open: there may be no descriptor left to open it with.
  DIR* const folder_;
  std::atomic<std::size_t> limit_;
  std::atomic<std::size_t> open_{0};
  std::atomic<std::size_t> ended_{0};
};

}  // namespace stepdriver::ros_node
