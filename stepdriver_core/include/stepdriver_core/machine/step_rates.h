#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::machine {

/// The highest step rate of one axis, on a computer and lines that were measured, at the configured
/// microsteps.
struct StepRate {
  std::string axis;
  double asked = 0.0;  ///< [steps/s] at the axis's top speed
  double alone = 0.0;  ///< [steps/s] that can be sustained if no other axis moves
  double held = 0.0;  ///< [steps/s] that can be sustained while all others move at their top speeds
  std::string limited;           ///< what limits `held`, in words
  double steps_per_round = 0.0;  ///< the motor's steps; 0: not known

  /// Whether the computer can sustain the rate that the axis needs.
  bool holds() const { return asked <= held; }
  /// "x needs 8000 steps/s (150 rpm), and this computer can sustain 12500 steps/s (234 rpm): ..."
  std::string text() const;
};

/// The step rates of all axes.
///
/// @code{.cpp}
/// const pulse::Capability measured = machine::measure(config.axes, backend, clock);
/// for (const machine::StepRate& rate : machine::stepRates(config.axes, measured).axes) {
///   std::cout << rate.text() << "\n";
/// }
/// @endcode
struct StepRates {
  std::vector<StepRate> axes;

  /// Whether the computer can sustain the rates of all axes.
  bool holds() const;
  /// A sentence for each axis whose rate can't be sustained.
  std::vector<std::string> complaints() const;
};

/// The highest step rates, from the lateness l of wake-ups and the costs w of a write and r of an
/// endstop's read, each at its 99th percentile. With M microsteps in a full step, the chip's high
/// and low times h and d, and the sums over this and all other axes, an interval T can be sustained
/// if
///
///   A T >= l + sum(r + w), A = max(1/4, M Capability::late_steps)
///                                   a pulse must be out before its field is farther behind the
///                                   plan than the engine absorbs; A is 1/4 for more than
///                                   2 ms, the longest that is caught up. If h is so long
///                                   that the clock sleeps, the end of the pulse is late by another
///                                   l.
///   0.9 T >= sum(r + 2 w + h + d)   the pulses themselves, and room to catch up with the plan
///   T >= g + h + r + 2 w            if the clock spins for a guard g before an edge,
///   T >= (g + min(g, h) - s) / 0.8  less what a sleep is late by (s, a median): it may for so much
///                                   of the time
///   1 - product(1 - (g + min(g, h)) / T) <= 0.8, over all axes: the same for several
///
/// or if the first two are true with the lateness of waits that don't spin. At higher rates more
/// than about one step in a hundred slides the timeline: no step is lost and no pulse is too short,
/// but the motion takes longer than planned.
///
/// Steps of several axes that fall due at once are one call for each chip; that counts as one for
/// each axis here. Changes of DIR, and what the engine calculates, about a microsecond a step, are
/// left out.
///
/// @throw Error if the capability is that of another number of axes.
StepRates stepRates(const std::vector<config::AxisConfig>& axes,
                    const pulse::Capability& capability);

/// The same for the axes that move, at the rates at which they move.
///
/// @param rates [steps/s] of each axis; 0: it is at rest, and takes no time.
/// @return the axes that move.
/// @throw Error if there is another number of rates, or as stepRates().
StepRates stepRatesInMotion(const std::vector<config::AxisConfig>& axes,
                            const pulse::Capability& capability, const std::vector<double>& rates);

/// Why a machine with MachineOptions::enforce doesn't start; empty if it does.
std::string whyNotInRealtime(const std::vector<config::AxisConfig>& axes,
                             const pulse::Capability& capability);

/// Requests the lines of the axes like a Machine, measures, and releases them. Nothing moves, and
/// ENABLE isn't asserted.
///
/// @param request see MachineOptions.
/// @throw ConfigError as config::checkAxes().
/// @throw GpioError if a line can't be requested, written or read; no line is held then.
pulse::Capability measure(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock, const pulse::RealtimeRequest& request = {});

}  // namespace stepdriver::machine
