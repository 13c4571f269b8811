#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// The state of an output with a name.
struct OutputState {
  std::string name;
  bool on = false;  ///< as its line was written last
  /// The same: 0 off, 1 on, and between them a PWM output that is on in part.
  double value = 0.0;
  /// On the clock of the machine, when that write had ended; empty: it has not changed since the
  /// start.
  std::optional<pulse::Nanoseconds> changed;
  std::string note;   ///< why nobody's command has switched it; empty until that happens
  std::string error;  ///< why its line could not be written, so that `on` isn't certain
  std::string axis;   ///< whose position switches it; empty: none does
  /// What positions have made it do since the start.
  std::uint64_t compared = 0;
  /// What they could not: a pulse was due while the one before it was on, or the output was in its
  /// safe state.
  std::uint64_t missed = 0;
};

/// The state of an input with a name.
struct InputState {
  std::string name;
  bool active = false;
  /// On the clock of the machine: the time of the edge, or of the reading if no edge was reported.
  /// Empty: it has not changed since the start.
  std::optional<pulse::Nanoseconds> changed;
  std::string error;  ///< why it can't be read: `active` is then the last reading
};

/// The lines with a name, in the order of the configuration.
///
/// @code{.cpp}
/// for (const machine::InputState& input : machine.ioStates().inputs) {
///   std::cout << input.name << (input.active ? " is active\n" : " is not active\n");
/// }
/// @endcode
struct IoStates {
  std::vector<OutputState> outputs;
  std::vector<InputState> inputs;
};

inline bool operator==(const OutputState& one, const OutputState& other) {
  return one.name == other.name && one.on == other.on && one.value == other.value &&
         one.changed == other.changed && one.note == other.note && one.error == other.error &&
         one.axis == other.axis && one.compared == other.compared && one.missed == other.missed;
}
inline bool operator==(const InputState& one, const InputState& other) {
  return one.name == other.name && one.active == other.active && one.changed == other.changed &&
         one.error == other.error;
}
inline bool operator==(const IoStates& one, const IoStates& other) {
  return one.outputs == other.outputs && one.inputs == other.inputs;
}
inline bool operator!=(const IoStates& one, const IoStates& other) { return !(one == other); }

}  // namespace stepdriver::machine
