#pragma once

#include <atomic>
#include <cstdint>

namespace stepdriver::pulse {

/// The emergency stops of an engine, in three counts: those that were requested, by any thread;
/// those that were served, when the current pulse has fallen and every motion has ended; and those
/// that were cleared. The engine is stopped while more were requested than cleared, so a stop that
/// comes while an earlier one is being cleared is never lost.
///
/// ask() may be called from any thread, serve() from the pulse thread, clear() from one thread at a
/// time.
class StopCounts {
 public:
  /// @return the count of requested stops, including this one.
  std::uint64_t ask() { return asked_.fetch_add(1, std::memory_order_acq_rel) + 1; }
  /// All stops that were requested up to this count have been served.
  void serve(std::uint64_t asked) { served_.store(asked, std::memory_order_release); }
  /// All stops that were served up to this count are cleared.
  void clear(std::uint64_t served) { cleared_.store(served, std::memory_order_release); }

  std::uint64_t asked() const { return asked_.load(std::memory_order_acquire); }
  std::uint64_t served() const { return served_.load(std::memory_order_acquire); }
  bool stopped() const { return asked() != cleared_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::uint64_t> asked_{0};
  std::atomic<std::uint64_t> served_{0};
  std::atomic<std::uint64_t> cleared_{0};
};

}  // namespace stepdriver::pulse
