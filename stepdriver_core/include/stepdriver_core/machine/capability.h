#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// What was measured of a machine and its wiring.
struct Capability {
  pulse::WakeUps wake_ups;
  std::vector<pulse::CallCost> calls;  ///< by axis
};

/// What limits the step rate of an axis.
enum class RateLimit {
  kLateness,  ///< lateness and calls must fit into what the engine absorbs of an interval
  kPulse,     ///< the pulse with its calls must fit into the interval
  kSpinning,  ///< the pulse thread would spin for longer than it may
};

/// The step rate that an axis asks for and the ones that can be held [steps/s], at the configured
/// microsteps.
struct StepRate {
  std::string axis;
  double asked = 0.0;                      ///< at the top speed
  double alone = 0.0;                      ///< held while no other axis moves
  double held = 0.0;                       ///< held while all others move at their top speeds
  RateLimit limit = RateLimit::kLateness;  ///< of `held`
  std::string reason;                      ///< that limit with its figures, in words

  bool enough() const { return asked <= held; }
};

/// The highest step rates at which each wake-up and each call, taken at its 99th percentile, leaves
/// the timeline where it is: about one step in a hundred may be late enough to slide it.
///
/// With the lateness l, the write w and the endstop's read r of an axis, the chip's high time h and
/// low time d, and the same of all other axes (index o), an interval T holds where
///
///   T >= 4 (l + r + w + sum(r_o + w_o))             the engine absorbs a quarter of an interval:
///   so
///                                                   much, after the planned time, may the write of
///                                                   a pulse end (PulseEngine::kClosest)
///   T >= 2 l + r + 2 w + h + d + sum(r_o + 2 w_o)   the pulse, both of its waits late
///   T >= g + h + r + 2 w, T >= (g + min(g, h) - s) / 0.8
///                                                   the pulse thread spins for the clock's guard g
///                                                   before an edge, less what a sleep is late by
///                                                   (s, its median), and may for so much of the
///                                                   time (SteadyClock::kMostSpinning)
///   1 - product over all axes (1 - (g + min(g, h)) / T) <= 0.8
///                                                   the same for several axes
///
/// or where the first two hold with the lateness of waits without spinning. Steps of several axes
/// that fall due at once are written in one call for each chip; that is counted as one for each
/// axis, so that chips need not be known. Changes of DIR and what the engine calculates, less than
/// a microsecond a step, are left out.
///
/// @param capability of these axes.
std::vector<StepRate> stepRates(const std::vector<axis::AxisConfig>& axes,
                                const Capability& capability);

/// Every axis that asks for more than can be held, a sentence each.
std::vector<std::string> shortfalls(const std::vector<StepRate>& rates);

/// Why there can't be a machine under RealtimePolicy::kEnforce; empty: there can.
///
/// @param shortfalls of its axes.
std::string enforcementRefusal(const pulse::RealtimeRights& rights,
                               const std::vector<std::string>& shortfalls);

/// What to do about a step rate that can't be held.
std::string remedyForRates();

/// Takes the lines of the axes as a Machine does, measures, and releases them. Nothing moves, and
/// ENABLE isn't asserted. For a clock with realtime().
///
/// @throw GpioError where a line can't be had or a call fails; then none is held.
Capability measure(const std::vector<axis::AxisConfig>& axes, gpio::Backend& backend,
                   pulse::Clock& clock);

}  // namespace stepdriver::machine
