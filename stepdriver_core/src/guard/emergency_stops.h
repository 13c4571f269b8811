#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "guard/stop_counts.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The emergency stops of an engine, and the ramp of one that lets the axes decelerate first.
///
/// ask(), askAtOnce() and the counts are for any thread, all else is for the pulse thread.
class EmergencyStops {
 public:
  /// From an emergency stop with a ramp until each channel must have an order to decelerate.
  static constexpr Nanoseconds kRampBegins = 100'000'000;

  /// @name Counts of requested stops, see StopCounts
  /// @{
  std::uint64_t ask() { return counts_.ask(); }
  /// The same, without a ramp, and it ends the one of earlier stops.
  std::uint64_t askAtOnce();
  std::uint64_t asked() const { return counts_.asked(); }
  std::uint64_t served() const { return counts_.served(); }
  bool stopped() const { return counts_.stopped(); }
  bool unserved() const { return asked() != served(); }
  /// @param asked a count that asked() has returned: all stops up to it have been served.
  void serve(std::uint64_t asked) { counts_.serve(asked); }
  void clear(std::uint64_t served) { counts_.clear(served); }
  /// @}

  /// @name The emergency-stop input
  /// @{
  /// @param active also if it can't be read. If it is still active after a clear, that is another
  ///   stop. It ends no ramp, because its contacts bounce.
  void readInput(bool active);
  /// How often it requested a stop.
  std::uint64_t inputStops() const { return input_stops_.load(std::memory_order_acquire); }
  /// @}

  /// @name The ramp
  /// @{
  /// @param longest 0: stops have no ramp.
  void rampStops(Nanoseconds longest) { longest_ = longest; }
  /// The count of requested stops when the last ramp began.
  std::uint64_t ramping() const { return ramping_.load(std::memory_order_acquire); }
  bool isRamping() const;
  /// Begins the ramp of a new stop.
  /// @return whether it has begun now.
  bool beginRamp(Nanoseconds now);
  /// Whether motions may decelerate. @param all_slow each of them has the order to.
  template <typename AllSlow>
  bool mayRamp(Nanoseconds now, const AllSlow& all_slow) const {
    return isRamping() && now < began_ + longest_ && (now < began_ + kRampBegins || all_slow());
  }
  /// Clock time at which the ramp must be looked at again.
  template <typename AllSlow>
  Nanoseconds due(const AllSlow& all_slow) const {
    if (longest_ == 0 || !isRamping()) return kNever;
    return began_ + (longest_ <= kRampBegins || all_slow() ? longest_ : kRampBegins);
  }
  /// @}

 private:
  StopCounts counts_;
  std::atomic<std::uint64_t> input_stops_{0};
  std::atomic<std::uint64_t> at_once_{0};  // stops up to this count have no ramp
  std::atomic<std::uint64_t> ramping_{0};
  std::uint64_t until_ = 0;    // the ramp ends at a stop with a higher count
  bool input_active_ = false;  // its last reading
  Nanoseconds longest_ = 0;
  Nanoseconds began_ = 0;
};

}  // namespace stepdriver::pulse
