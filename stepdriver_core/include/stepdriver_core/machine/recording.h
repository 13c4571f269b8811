#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// Why there is no recording, for messages.
constexpr const char* kNothingRecorded = "nothing is recorded: recorder/seconds is 0";

/// The last seconds of a machine: each edge of its outputs, and what it was asked and did. Times
/// are those of its clock; edges and events are in the order of time.
///
/// @code{.cpp}
/// const machine::Recording recording = machine.recording();
/// for (const machine::Recording::Event& event : recording.events) {
///   const double ago = static_cast<double>(recording.end - event.time) * 1e-9;
///   std::cout << ago << " s ago: " << event.text << "\n";
/// }
/// @endcode
struct Recording {
  /// An output of an axis. Axes can share one.
  struct Pin {
    std::string axis;     ///< `machine` or `outputs` for lines that belong to no axis
    std::string name;     ///< step, dir (or cw, ccw), enable, ms1, ms2, ms3, sleep or reset
    int output = 0;       ///< index in `levels`
    bool active = false;  ///< the level of a pulse, of forward, of an energized motor, of the bit
                          ///< 1, of sleep and of reset
    bool both_edges = false;  ///< each edge of it is a step
  };
  /// The level of an output changed.
  struct Edge {
    pulse::Nanoseconds time = 0;  ///< the end of the write that made it
    int output = 0;
    bool level = false;
  };
  /// A command, its answer, a plan, the end of a motion, a fault and so on.
  struct Event {
    pulse::Nanoseconds time = 0;
    std::string text;
  };

  pulse::Nanoseconds begin = 0;  ///< every edge from here on is in the recording
  pulse::Nanoseconds end = 0;
  bool shortened = false;  ///< it begins later than it should, because the memory was full
  std::vector<Pin> pins;
  std::vector<bool> levels;  ///< levels of the outputs at the beginning
  std::vector<Edge> edges;
  std::vector<Event> events;
  bool events_lost = false;  ///< there were more events than fit
};

}  // namespace stepdriver::machine
