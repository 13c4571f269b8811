#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

/// Inputs and outputs with a name: their states, and requests that wait for an edge.
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

/// Which edges of an input count.
enum class LatchEdge { kActive, kInactive, kEither };

/// Edges count only while an axis is between two positions.
struct LatchWindow {
  std::string axis;
  double from = 0.0;  ///< [unit]
  double to = 0.0;    ///< [unit] at least `from`
};

/// A request for the positions of axes at edges of an input with a name.
///
/// @code{.cpp}
/// machine::LatchRequest request;
/// request.input = "probe";
/// const machine::Latch latch = machine.latch(request);
/// machine.axis("x").moveTo(0.1);
/// const machine::LatchResult result = machine.wait(latch);
/// const double x = result.edge->axes.front().position;  // [m]
/// @endcode
struct LatchRequest {
  std::string input;
  LatchEdge edge = LatchEdge::kActive;
  bool every = false;             ///< false: the first edge ends it
  std::vector<std::string> axes;  ///< empty: all
  std::optional<LatchWindow> window;
};

/// A position that was latched.
struct LatchedAxis {
  std::string name;
  double position = 0.0;        ///< [unit] of the joint, as it was planned to be at that time
  bool position_valid = false;  ///< whether the position of the axis can be trusted
};

/// An edge of the input.
struct LatchedEdge {
  std::uint64_t number = 0;  ///< of the edges of this latch, from 1 on
  bool active = false;       ///< the input became active; false: inactive
  /// On the clock of the machine, by the kernel's time stamp; with a debounce time that of the
  /// first contact.
  pulse::Nanoseconds time = 0;
  /// The kernel has reported no such edge: it has lost it, and the time is that of the reading that
  /// shows the level. LatchResult::message says so of the edge that ends a latch.
  bool was_read = false;
  std::vector<LatchedAxis> axes;
};

/// How a latch ended.
struct LatchResult {
  bool latched = false;             ///< there was an edge
  std::string message;              ///< a sentence that says how it ended
  std::optional<LatchedEdge> edge;  ///< the last one
  std::uint64_t edges = 0;          ///< how many there were
};

/// What a latch has seen. Any thread may read it.
class LatchRecord {
 public:
  /// The edges since the last call. Of more than kMostKept only the latest are there.
  std::vector<LatchedEdge> take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto edges = std::exchange(edges_, {});
    return {edges.begin(), edges.end()};
  }
  /// Empty: it hasn't ended.
  std::optional<LatchResult> result() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return result_;
  }
  void add(LatchedEdge edge) {
    const std::lock_guard<std::mutex> lock(mutex_);
    edges_.push_back(std::move(edge));
    if (edges_.size() > kMostKept) edges_.pop_front();
  }
  /// Only the first result counts.
  void end(LatchResult result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!result_) result_ = std::move(result);
  }

 private:
  static constexpr std::size_t kMostKept = 10'000;

  mutable std::mutex mutex_;
  std::deque<LatchedEdge> edges_;
  std::optional<LatchResult> result_;
};

/// A latch that was accepted.
struct Latch {
  std::uint64_t id = 0;
  std::shared_ptr<LatchRecord> record;
};

/// A probing: a straight line until an input with a name tells of a contact.
///
/// @code{.cpp}
/// machine::ProbeRequest request;
/// request.input = "probe";
/// request.names = {"z"};
/// request.positions = {-0.02};  // [m] the farthest
/// request.velocity = 0.005;     // [m/s]
/// const double z = machine.probe(request).contact.front();
/// @endcode
struct ProbeRequest {
  std::string input;
  std::vector<std::string> names;  ///< the axes' names, each once
  /// [unit] Where the line ends without a contact, one for each name.
  std::vector<double> positions;
  bool relative = false;
  bool away = false;      ///< the contact is where the input becomes inactive, not active
  bool must = true;       ///< without a contact it has failed
  double velocity = 0.0;  ///< as of motion::LineRequest; 0: as fast as the limits of the axes allow
  /// A second touch at this velocity, from back_off before the first contact; 0: none.
  double second_velocity = 0.0;
  double back_off = 0.0;  ///< [unit] along the line; above 0 for a second touch
  bool returns = false;   ///< at the end the axes stand at the contact, not where they came to rest
};

/// How a probing ended.
enum class ProbeEnd {
  kContact,
  kNoContact,
  kCancelled,
  kFailed,  ///< something else ended it: a stop, a fault, an endstop, another command
};

/// What a probing has found, and where the axes stand after it.
struct ProbeResult {
  ProbeEnd end = ProbeEnd::kFailed;
  bool succeeded = false;       ///< there was a contact, or it need not be
  std::string message;          ///< a sentence that says how it ended
  std::vector<double> contact;  ///< [unit] of the last touch; empty if there was none
  /// The kernel has reported no edge of it: the contact is where the axes were when the input was
  /// read, as LatchedEdge::was_read. The message says so.
  bool was_read = false;
  std::vector<double> positions;  ///< [unit] where the axes stand
};

}  // namespace stepdriver::machine
