#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "activity/context.h"
#include "input.h"
#include "port/pin_ring.h"
#include "port/record_ring.h"
#include "snapshot.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/machine/recording.h"
#include "wiring.h"

namespace stepdriver::machine {

/// Keeps the last seconds of a machine in memory: each edge of its outputs in rings without
/// allocation, and what the controller was asked and did, in words.
///
/// Three threads write, each to a ring of its own: the pulse thread, the line writers one after
/// another, and the thread of the controller. None of them ever waits for a reader.
class FlightRecorder {
 public:
  struct Options {
    double seconds = 10.0;           ///< above 0
    std::size_t bytes = 16'000'000;  ///< the most memory for edges
    std::vector<config::OutputConfig> outputs{};
  };

  /// @param names of the lines, for events. @param now nothing is recorded before.
  /// @throw Refused if there are too many outputs.
  FlightRecorder(const std::vector<config::AxisConfig>& axes, const Wiring& wiring,
                 axis::LineNames names, pulse::Nanoseconds now, const Options& options);

  /// [s] How far back the edges go if all axes move at their top speeds all the time.
  double secondsAtTopSpeed() const { return seconds_at_top_speed_; }

  pulse::PinRing& pulseRing() { return pulse_ring_; }
  /// A line writer has written an output. From one thread at a time.
  void addWrite(const gpio::LineWrite& write, pulse::Nanoseconds now) {
    if (switched_[static_cast<std::size_t>(write.output)]) {
      return other_ring_.addChange(write.output, write.level, now);
    }
    other_ring_.add(write.output, write.level, now);
  }

  /// @name Only for the controller's thread
  /// @{
  void addInput(const Input& input);
  /// @param before, after the snapshots before and after the turn.
  void addTurn(const Input& input, const activity::Outputs& out, const MachineSnapshot& before,
               const MachineSnapshot& after);
  /// @}

  /// @param told called in the thread of the controller when an axis gets a fault. It returns at
  ///   once. Called here if there was a fault before.
  void onFault(std::function<void()> told);

  /// Any thread may call it.
  Recording recording(pulse::Clock& clock) const;

 private:
  static constexpr std::size_t kTextWords = 24;
  using EventRing = pulse::RecordRing<1 + kTextWords>;

  void note(pulse::Nanoseconds time, const std::string& text);
  void noteNews(const Input& input, const EngineNews& news);
  void notePlans(const Input& input, const pulse::Command& command,
                 const MachineSnapshot& snapshot);
  void noteFaults(pulse::Nanoseconds now, const MachineSnapshot& before,
                  const MachineSnapshot& after);
  void readEvents(Recording& recording) const;

  const std::vector<config::AxisConfig> axes_;
  const axis::LineNames names_;
  const pulse::Nanoseconds started_;
  const pulse::Nanoseconds length_;
  std::vector<Recording::Pin> pins_;
  double seconds_at_top_speed_ = 0.0;
  pulse::PinRing pulse_ring_;
  pulse::PinRing other_ring_;
  std::vector<bool> switched_;  // by output: it has a name, and paths write it too
  EventRing events_;

  // Only the controller's thread uses these.
  EngineNews news_;
  pulse::Nanoseconds slipped_ = 0;
  std::map<std::uint64_t, int> jobs_;  // output of each write that a line writer makes

  std::mutex mutex_;  // guards the two below
  std::function<void()> on_fault_;
  bool faulty_before_ = false;
};

}  // namespace stepdriver::machine
