#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim_time.h"
#include "stepdriver_core/sim/pin_trace.h"
#include "switch_model.h"

namespace stepdriver::sim {

/// Writes the edges of pins and the bounces of switches, for which there are no calls at their
/// time, to a trace in the order of time. Does nothing without a trace.
class TraceFeed {
 public:
  explicit TraceFeed(std::shared_ptr<PinTrace> trace) : trace_(std::move(trace)) {}

  /// @return the index of the pin, for settle() and edge().
  int addPin(const TracePin& pin, bool level);

  /// @param contact outlives the feed.
  void addSwitch(const TracePin& pin, const SwitchModel* contact);

  /// A request gave the pin this level. Lines are requested one by one, but at the same time: the
  /// trace begins with the levels of all of them.
  void settle(int pin, bool level, std::int64_t time_ns);
  void edge(int pin, bool level, std::int64_t time_ns);

  /// Writes the bounces up to this time.
  void advance(std::int64_t time_ns);

  /// Writes the latest changes of switches.
  void switchesMoved(std::int64_t time_ns);

  void flush();

  /// Writes all remaining bounces, and words about the whole trace. No edge may follow.
  void finish(const std::vector<std::string>& summary);

 private:
  struct Contact {
    const SwitchModel* contact;
    int pin;
  };

  bool settling(std::int64_t time_ns) const;
  void begin();
  void record(int pin, bool level, std::int64_t time_ns);

  std::shared_ptr<PinTrace> trace_;
  std::vector<TracePin> pins_;
  std::vector<bool> levels_;
  std::vector<Contact> contacts_;
  std::optional<std::int64_t> start_ns_;
  std::int64_t next_bounce_ns_ = kNever;
  bool begun_ = false;
};

}  // namespace stepdriver::sim
