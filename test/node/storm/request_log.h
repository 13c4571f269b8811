#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::storm {

/// What a request may do to an axis, as far as the oracle needs it.
enum class Kind {
  kMotion,  ///< begins a motion of its axes
  kHoming,  ///< begins a motion, and changes the origin of the positions
  kJog,     ///< the first message of a jog, after a pause or a 0, or of setpoints, after a pause
  kStop,
  kHold,
  kResume,
  kEnable,
  kDisable,
  kSleep,
  kWake,
  kEmergencyStop,
  kRecover,
  kSetPosition,
  kOther,
};

/// Bit i stands for axis i.
using AxisSet = unsigned;

/// The position of an axis according to an answer, and its target.
struct Arrival {
  std::size_t axis = 0;
  double wanted = 0.0;  ///< [m]
  double told = 0.0;    ///< [m]
};

/// Between which positions a request itself leads an axis.
struct Reach {
  std::size_t axis = 0;
  double low = 0.0;       ///< [m]
  double high = 0.0;      ///< [m]
  bool relative = false;  ///< they count from where the axis rests before it
};

/// How a request switches an output.
struct OutputOrder {
  std::size_t output = 0;
  bool on = false;
};

/// Pulses of an output at places of an axis, or something else that the position of an axis does.
struct CompareOrder {
  bool has_pulses = false;  ///< false: cams, or nothing any more
  std::size_t axis = 0;
  int direction = 0;      ///< 1, -1 or both (0)
  double distance = 0.0;  ///< [m] from place to place
  double begin = 0.0;     ///< [m] the first one
  double end = 0.0;       ///< [m]
  double pulse = 0.0;     ///< [s]
};

/// A place at which a path switches an output.
struct MarkOrder {
  std::size_t output = 0;
  bool on = false;
  double lead = 0.0;             ///< [s] how much earlier
  std::vector<double> position;  ///< [m] of each axis of the request, from where it rests before it
};

/// What a probing looks for.
struct ProbeOrder {
  std::size_t axis = 0;
  bool active = false;  ///< the input's level at the contact
};

/// Edges count only while an axis is there.
struct WindowOrder {
  std::size_t axis = 0;
  double from = 0.0;  ///< [m]
  double to = 0.0;    ///< [m]
};

/// What an answer tells in addition to success and message.
struct Answer {
  std::vector<Arrival> arrivals;
  std::optional<double> contact;  ///< [m] of the axis of a probing
};

/// A request and its result. Times are in nanoseconds of CLOCK_MONOTONIC.
struct Request {
  int client = 0;
  Kind kind = Kind::kOther;
  AxisSet axes = 0;
  std::string text;            ///< as a person would write it
  bool has_answer = true;      ///< false: a message of a topic or an action, which nobody answers
  bool waits = false;          ///< it is answered when its motion has ended
  bool is_trajectory = false;  ///< its axes may stop more slowly
  bool is_path = false;        ///< and still more slowly: it is at the limits everywhere
  std::int64_t sent = 0;
  std::optional<std::int64_t> answered;
  bool success = false;
  std::string message;
  Answer answer;
  std::vector<Reach> reaches;  ///< one for each of its axes. Empty: that isn't known
  std::optional<OutputOrder> output = {};
  std::optional<CompareOrder> compare = {};
  std::vector<std::size_t> path_axes = {};  ///< those of the positions of marks
  std::vector<MarkOrder> marks = {};        ///< in the order of the path; empty: none are judged
  std::optional<ProbeOrder> probe = {};
  std::optional<WindowOrder> window = {};  ///< of a latch
};

std::int64_t steadyNow();

/// All requests in the order in which they were sent. Thread-safe.
class RequestLog {
 public:
  /// @return the number to pass to end().
  std::size_t begin(Request request);
  void end(std::size_t index, bool success, std::string message, Answer answer);

  std::vector<Request> requests() const;
  std::size_t count() const;

 private:
  mutable std::mutex mutex_;
  std::vector<Request> requests_;
};

}  // namespace stepdriver::storm
