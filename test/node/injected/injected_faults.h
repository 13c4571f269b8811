#pragma once

#include <atomic>
#include <cstdint>

namespace stepdriver::node_test {

/// What the library that a test loads into a node (LD_PRELOAD) makes its C library do. It lies in a
/// file that the test and the node map.
struct InjectedFaults {
  static constexpr const char* kFileVariable = "STEPDRIVER_INJECTED_FAULTS";

  /// [ns] Added to the wall clock, also for waits that are under way: as if somebody set the clock.
  std::atomic<std::int64_t> wall_clock_ns;

  /// The errno of each call that opens, writes, syncs or renames a file whose path begins with
  /// `folder`; 0: it succeeds.
  std::atomic<int> open_error;
  std::atomic<int> read_error;
  std::atomic<int> write_error;
  std::atomic<int> sync_error;
  std::atomic<int> rename_error;
  char folder[256];

  /// How many threads can still be started; the next one fails with EAGAIN. Below 0: any number.
  std::atomic<std::int64_t> threads_left;

  /// How many calls of operator new still succeed; all later ones fail. Below 0: all succeed.
  std::atomic<std::int64_t> allocations_left;
  std::atomic<std::int64_t> allocations;  ///< calls of operator new until now
};

}  // namespace stepdriver::node_test
