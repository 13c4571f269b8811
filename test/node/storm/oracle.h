#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "storm/request_log.h"
#include "storm/rig_clock.h"

namespace stepdriver::storm {

/// The oracle's data about an axis.
struct AxisFacts {
  std::string name;
  double longest_stop = 0.0;     ///< [s] from its maximum speed and its maximum acceleration
  double steps_per_metre = 0.0;  ///< in 1/16 steps, or half steps of a motor of phases
  double backlash = 0.0;         ///< [m]
  double min_position = 0.0;     ///< [m] its soft limits
  double max_position = 0.0;     ///< [m]
};

/// A pulse that the rig saw.
struct Pulse {
  std::int64_t time = 0;   ///< [ns] on the rig's clock
  std::int64_t count = 0;  ///< forward less backward, with this pulse, in the steps of AxisFacts
};

/// A change of an output or an input.
struct Switch {
  std::int64_t time = 0;  ///< [ns] on the rig's clock
  bool on = false;
};

/// What an output promises.
struct OutputFacts {
  std::string name;
  /// [ns] How long it is on at most, and on and off at least; only if `is_timed`.
  bool is_timed = false;
  std::int64_t max_on = 0;
  std::int64_t min_on = 0;
  std::int64_t min_off = 0;
};

/// An edge of the input that the first axis presses, as a latch tells it.
struct Latched {
  std::int64_t received = 0;  ///< [ns] of CLOCK_MONOTONIC
  std::size_t request = 0;    ///< the number of the latch in Observation::requests
  bool active = false;
  std::vector<double> positions;  ///< [m] of each axis
};

/// A moment at which every axis was at rest, and what the node said then.
struct RestPoint {
  std::int64_t time = 0;          ///< [ns] of CLOCK_MONOTONIC
  std::vector<double> positions;  ///< [m] of each axis
  std::vector<bool> valid;  ///< of each axis: its position can be trusted, and it has no fault
  bool alone = false;       ///< since the rest before it, at most one motion was asked for
};

/// A time in which this computer didn't run what was ready to run.
struct Stall {
  std::int64_t begin = 0;
  std::int64_t end = 0;
};

/// What happened.
struct Observation {
  std::vector<AxisFacts> axes;
  std::vector<Request> requests;
  std::vector<std::vector<Pulse>> pulses;     ///< those of each axis
  std::vector<OutputFacts> outputs;           ///< a position switches the first one
  std::vector<std::vector<Switch>> switches;  ///< of each output, from off on, in their order
  std::vector<Switch> input;                  ///< changes of the input of the latches
  std::vector<Latched> latched;
  std::vector<RestPoint> rests;
  std::vector<Stall> stalls;
  std::vector<ClockReading> clock;  ///< what the rig's clock showed
};

/// Compares an observation with the node's promises:
///
/// - After the answer of an emergency stop, a disable or a sleep there are no pulses; after the
///   answer of a stop or a hold there are none later than the longest deceleration and 10 %. This
///   ends when a newer motion can have begun: one that was requested later and that nothing forbids
///   any longer.
/// - From the answer of an emergency stop until a newer recover can have come, all outputs are off.
/// - If an answer says that an output was switched, it was so between the request and the answer.
/// - An output with least times and a longest one keeps them, except that its safe state doesn't
///   wait for its least time on.
/// - If an answer says that a position was reached, it was reached.
/// - The reported position is the count of the pulses.
/// - Places: see brokenPlaces().
/// - Pulses never lead an axis beyond its soft limits. If only one request for motion comes between
///   two moments of rest, they never leave the way that this request describes.
///
/// Requests that were under way at the same time may have been handled in either order, so neither
/// is compared with the other.
///
/// @return each broken promise in words.
std::vector<std::string> brokenPromises(const Observation& observation);

/// The last requests that were sent between two times, one per line, with times relative to
/// `origin`.
std::string requestsText(const std::vector<Request>& requests, std::int64_t begin, std::int64_t end,
                         std::int64_t origin);

}  // namespace stepdriver::storm
