#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "kernel_trace.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/driver/driver_chip.h"

/// The waveform of an axis as the kernel sent it, compared with the requirements of the driver
/// chip.
///
/// The chip needs its times from the end of one write to the beginning of the next. The kernel
/// takes the time of a write during the write, so the time between two writes is never shorter than
/// the engine's own: limits are exact to the nanosecond.
namespace stepdriver::kernel {

struct WiredPin {
  unsigned line = 0;      ///< from KernelTrace::line()
  bool inverted = false;  ///< the wiring inverts the level between line and chip
};

/// The wiring of an axis, and its required times.
struct WiredAxis {
  driver::DriverChip driver = driver::driverChip("a4988");
  WiredPin step;
  WiredPin dir;
  std::optional<WiredPin> enable;  ///< none: not wired, the motor is always energized
  /// Shortest time from one active STEP edge to the next, as it was planned; 0: any.
  std::int64_t shortest_interval_ns = 0;
  /// Changes of STEP and DIR that are this close were made by one write: the kernel takes a time
  /// for each line of a write, one after another. On the test kernel a line takes 256 ns of virtual
  /// time, or usually less real time, and two writes are further apart than this. 0: only changes
  /// at the same time.
  std::int64_t one_write_ns = 1'000;
};

/// The wiring of an axis according to its configuration.
/// @throw Error if the trace doesn't know a line's chip: pins must be named label:offset.
WiredAxis wiredAxis(const config::AxisConfig& config, const KernelTrace& trace);

enum class Rule {
  kStepHigh,
  kStepLow,
  kDirSetup,
  kDirHold,
  kOneWrite,    ///< STEP and DIR don't change in one write, because the lines of a write may change
                ///< in any order
  kEnabled,     ///< no step without ENABLE, or before ENABLE is first driven
  kEnableTime,  ///< from ENABLE to the first step
  kInterval,
  kRest,  ///< STEP is inactive when it is requested, and at the end
};

/// The name of the rule in reports, such as `STEP high time`.
const char* nameOf(Rule rule);

struct Violation {
  Rule rule;
  std::int64_t time_ns;  ///< when the edge came that broke the rule
  std::int64_t seen_ns;
  std::int64_t least_ns;  ///< the least allowed time; 0 if the rule has no time
};

/// An active STEP edge.
struct Pulse {
  std::int64_t time_ns;
  bool forward;
};

/// The shortest times that occurred; no value if there were no two such edges.
struct ShortestTimes {
  std::optional<std::int64_t> high;
  std::optional<std::int64_t> low;
  std::optional<std::int64_t> interval;
  std::optional<std::int64_t> dir_setup;  ///< from the last change of DIR, or its request
  std::optional<std::int64_t> dir_hold;
};

/// What the kernel did to the lines of an axis.
struct Waveform {
  std::vector<Pulse> pulses;
  std::size_t edges = 0;  ///< changes of STEP, DIR and ENABLE
  ShortestTimes shortest;
  std::vector<Violation> violations;  ///< in the order of time

  std::int64_t forward() const;
  std::int64_t backward() const;
  /// The sum of the pulses, which is the final position if the axis began at 0.
  std::int64_t position() const { return forward() - backward(); }
  std::map<Rule, std::size_t> violationsByRule() const;
};

/// @throw Error if one of the lines has no event: its number is wrong, or nothing drove it.
Waveform waveformOf(const KernelTrace& trace, const WiredAxis& axis);

/// What a motor makes of pulses.
struct MotorView {
  double largest_lag_degrees = 0.0;  ///< [electrical degrees] of its rotor behind its field
  std::int64_t lost_steps = 0;       ///< full steps
};

/// What a common NEMA 17 motor without a load and with little damping makes of pulses, from rest to
/// a second after the last of them.
/// @param microsteps in a full step, the same for all of them.
MotorView motorViewOf(const std::vector<Pulse>& pulses, int microsteps);

/// The figures of a waveform in a few indented lines, and each broken rule with the first place
/// where it was broken.
std::string reportOf(const Waveform& waveform);

}  // namespace stepdriver::kernel
