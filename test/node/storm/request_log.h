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
  std::vector<Arrival> arrivals;
  std::vector<Reach> reaches;  ///< one for each of its axes. Empty: that isn't known
  std::optional<OutputOrder> output = {};
};

std::int64_t steadyNow();

/// All requests in the order in which they were sent. Thread-safe.
class RequestLog {
 public:
  /// @return the number to pass to end().
  std::size_t begin(Request request);
  void end(std::size_t index, bool success, std::string message, std::vector<Arrival> arrivals);

  std::vector<Request> requests() const;
  std::size_t count() const;

 private:
  mutable std::mutex mutex_;
  std::vector<Request> requests_;
};

}  // namespace stepdriver::storm
