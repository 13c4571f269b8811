#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "activity/activities.h"
#include "activity/context.h"
#include "channel/channel_config.h"
#include "machine/named_lines.h"
#include "machine/position_latches.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::machine {

/// An axis by its number in the configuration.
using AxisId = std::size_t;
using activity::SharedCall;

inline const activity::EarlyEnd kStopped{axis::MoveEnd::kStopped, "it was stopped"};
inline const activity::EarlyEnd kTakenOver{axis::MoveEnd::kReplaced, "another command took over"};

/// The words for axes in the texts of requests.
class AxisWords {
 public:
  /// @param axes outlive it.
  explicit AxisWords(const std::vector<config::AxisConfig>& axes) : axes_(axes) {}

  const std::string& name(AxisId axis) const { return axes_.at(axis).name; }
  std::string names(const std::vector<AxisId>& axes) const;
  const char* unit(AxisId axis) const { return config::unitOf(axes_.at(axis).kind); }
  /// ", velocity 0.1 m/s"; empty for 0.
  std::string velocity(AxisId axis, double value) const;

 private:
  const std::vector<config::AxisConfig>& axes_;
};

/// What requests are served with: the axes, their owners, and the checks that several requests
/// share.
class RequestContext {
 public:
  RequestContext(activity::Context& its_context, activity::Activities& its_activities,
                 const std::optional<pulse::Signal>& emergency_stop_input,
                 NamedLines lines_with_names)
      : context(its_context),
        activities(its_activities),
        emergency_stop(emergency_stop_input),
        named(std::move(lines_with_names)) {}

  activity::Context& context;
  activity::Activities& activities;
  const std::optional<pulse::Signal> emergency_stop;  ///< the machine's input
  NamedLines named;
  PositionLatches latches;
  std::vector<SharedCall> awaiting_rest;  ///< answered when every axis is at rest

  /// A current or a threshold that is being written to a driver chip.
  struct SettingChange {
    AxisId axis = 0;
    std::size_t motor = 0;
    SharedCall call;
  };
  std::map<std::uint64_t, SettingChange> setting_changes;  ///< by their jobs

  axis::AxisModel& axis(AxisId id) const { return *context.axes.at(id); }
  /// The axis, and all that share its motors.
  std::vector<axis::AxisModel*> withSharers(AxisId id) const;
  /// The plan of the axis's present or held motion; nullptr if there is none.
  const activity::Goal* goalOf(const axis::AxisModel& axis) const;
  /// The goal with a number of its own, and an outcome for its result.
  activity::Goal withOutcome(activity::Goal goal) const;
  std::uint64_t newHoming() { return ++homings_; }
  void disable(axis::AxisModel& axis, const activity::EarlyEnd& why, const SharedCall& call) const;

  /// Requires that the axis neither moves nor changes its pins. @param what is refused, in words.
  void refuseUnlessFree(const axis::AxisModel& axis, const std::string& what) const;
  void refuseUnlessReadyToMove(const axis::AxisModel& axis) const;
  /// Whether it is active, or can't be read.
  bool isEmergencyStopInputActive() const;
  void refuseWhileEmergencyStopInput() const;
  /// Why the outputs with a name must be in their safe states; empty: they needn't.
  std::string whySafe() const;

 private:
  void refuseUnlessSharersAreFree(const axis::AxisModel& axis, const std::string& what) const;

  std::uint64_t homings_ = 0;
};

/// [microsteps] The place of the joint of an axis at rest.
inline double restOf(const motion::PathStart& start) {
  return start.motor.position.value() - start.slack;
}

/// Why the drivers of an axis can't be switched by a pin that isn't wired.
std::string whyNoPin(const config::AxisConfig& axis,
                     std::optional<bool> driver::DriverChip::*active_level, const char* pin,
                     const char* name);

}  // namespace stepdriver::machine
