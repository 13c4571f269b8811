#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::machine {

/// The highest step rate of one axis, on a machine and lines as they were measured.
struct StepRate {
  std::string axis;
  double asked = 0.0;   ///< [steps/s] at the axis's top speed
  double held = 0.0;    ///< [steps/s] that can be held with this axis alone
  std::string limited;  ///< by what, in words

  bool holds() const { return asked <= held; }
  /// "x: asks for 8000 steps/s; this machine holds 12500 steps/s: ..."
  std::string text() const;
};

/// What a machine can do of what its axes ask for.
struct StepRates {
  std::vector<StepRate> axes;
  double load = 0.0;  ///< part of the pulse thread's time that calls take with all at top speed

  /// The kernel stops a real-time thread that takes more than this (sched_rt_runtime_us).
  static constexpr double kHighestLoad = 0.95;

  bool holds() const;
  /// What doesn't hold, a sentence each; empty: all does.
  std::vector<std::string> complaints() const;
};

/// The highest step rates.
///
/// A step needs its two writes, the read of the endstop ahead where there is one, and the chip's
/// high and low times: with costs as their medians these are the shortest interval of a thread that
/// is never late. Of a wake-up's lateness L (its p99) the engine makes good a quarter of an
/// interval at most (see PulseEngine::kClosest), and the pulse's falling edge may be late too; so
///
///   interval >= max(read + 2 write + high + low + L, 4 L).
///
/// Faster, more than about one step in a hundred slides the timeline: nothing is lost and no pulse
/// is too short, but the motion takes longer than planned.
StepRates stepRates(const std::vector<axis::AxisConfig>& axes, const pulse::Capability& capability);

}  // namespace stepdriver::machine
