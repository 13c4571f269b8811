#include "event_text.h"

#include <fmt/format.h>

#include "message_text.h"

namespace stepdriver::machine {
namespace {

/// A line for each kind of request.
class RequestText {
 public:
  explicit RequestText(const std::vector<config::AxisConfig>& axes) : axes_(axes) {}

  std::string operator()(const MoveTo& wanted) const { return "move " + move(wanted); }
  std::string operator()(const MoveRounds& wanted) const {
    return fmt::format("{}: move by {} revolutions{}", name(wanted.axis), numberText(wanted.rounds),
                       velocity(wanted.axis, wanted.velocity));
  }
  std::string operator()(const PlanMove& wanted) const { return "plan " + move(wanted.move); }
  std::string operator()(const Jog& wanted) const {
    return fmt::format("jog {}: {} {}/s", name(wanted.axis), numberText(wanted.velocity),
                       unit(wanted.axis));
  }
  std::string operator()(const JogTogether& wanted) const {
    std::string text;
    for (const Jog& jog : wanted.jogs) text += (text.empty() ? "" : ", ") + (*this)(jog);
    return text;
  }
  std::string operator()(const FollowSetpoints& wanted) const {
    std::string text;
    for (const Setpoint& setpoint : wanted.setpoints) {
      text += fmt::format("{}setpoint of {}: {} {}{}", text.empty() ? "" : ", ",
                          name(setpoint.axis), numberText(setpoint.value), unit(setpoint.axis),
                          wanted.mode == SetpointMode::kVelocity ? "/s" : "");
    }
    return text;
  }
  std::string operator()(const MoveLine& wanted) const {
    std::string text = "line";
    for (std::size_t i = 0; i < wanted.axes.size(); ++i) {
      text += fmt::format("{} {} {} {} {}", i == 0 ? "" : ",", name(wanted.axes[i]),
                          wanted.relative ? "by" : "to", numberText(wanted.positions.at(i)),
                          unit(wanted.axes[i]));
    }
    if (wanted.velocity > 0.0) text += fmt::format(", velocity {}", numberText(wanted.velocity));
    if (wanted.duration > 0.0) text += fmt::format(", duration {} s", numberText(wanted.duration));
    return text;
  }
  std::string operator()(const FollowTrajectory& wanted) const {
    const std::string what = "trajectory of " + names(wanted.axes);
    return wanted.begins_ns > 0 ? what + ", later" : what;
  }
  std::string operator()(const ExtendPath& wanted) const {
    return fmt::format("append to the path {} of {}", wanted.move, name(wanted.axis));
  }
  std::string operator()(const StopAxis& wanted) const { return "stop " + name(wanted.axis); }
  std::string operator()(const StopMove& wanted) const {
    return fmt::format("stop move {} of {}", wanted.move, name(wanted.axis));
  }
  std::string operator()(const StopAll& /*wanted*/) const { return "stop all axes"; }
  std::string operator()(const Hold& /*wanted*/) const { return "hold"; }
  std::string operator()(const Resume& /*wanted*/) const { return "resume"; }
  std::string operator()(const SetSpeedOverride& wanted) const {
    return "speed override " + numberText(wanted.factor);
  }
  std::string operator()(const SetLimits& wanted) const {
    const axis::AxisLimits& limits = wanted.limits;
    return fmt::format("set limits of {}: speed {}, acceleration {}, deceleration {}, jerk {}",
                       name(wanted.axis), numberText(limits.max_speed),
                       numberText(limits.acceleration), numberText(limits.deceleration),
                       numberText(limits.jerk));
  }
  std::string operator()(const Home& wanted) const {
    return (wanted.only_check ? "check the homing of " : "home ") + names(wanted.axes);
  }
  std::string operator()(const CancelHoming& wanted) const {
    return fmt::format("cancel {} homings", wanted.ids.size());
  }
  std::string operator()(const Enable& wanted) const {
    return (wanted.on ? "enable " : "disable ") + names(wanted.axes);
  }
  std::string operator()(const Sleep& wanted) const {
    return fmt::format("{}: {}", name(wanted.axis), wanted.asleep ? "sleep" : "wake");
  }
  std::string operator()(const Reset& wanted) const { return "reset " + name(wanted.axis); }
  std::string operator()(const SetMicrosteps& wanted) const {
    return fmt::format("{}: {} microsteps", name(wanted.axis), wanted.microsteps);
  }
  std::string operator()(const SetPosition& wanted) const {
    return fmt::format("set position of {}: {} {}", name(wanted.axis), numberText(wanted.position),
                       unit(wanted.axis));
  }
  std::string operator()(const Recover& /*wanted*/) const { return "recover"; }
  std::string operator()(const BringUp& /*wanted*/) const { return "bring up"; }
  std::string operator()(const RestorePosition& wanted) const {
    return fmt::format("restore position of {}: {} {}", name(wanted.axis),
                       numberText(wanted.memory.position), unit(wanted.axis));
  }
  std::string operator()(const NotePosition& wanted) const {
    return fmt::format("note on the position of {}: {}", name(wanted.axis), wanted.why);
  }
  std::string operator()(const Close& /*wanted*/) const { return "shut down"; }
  std::string operator()(const AwaitRest& /*wanted*/) const { return "wait for standstill"; }
  std::string operator()(const PowerDown& /*wanted*/) const { return "power down"; }

 private:
  const std::string& name(AxisId axis) const { return axes_.at(axis).name; }
  const char* unit(AxisId axis) const { return config::unitOf(axes_.at(axis).kind); }
  std::string names(const std::vector<AxisId>& axes) const {
    return joinedText(axes, [this](AxisId axis) { return name(axis); });
  }
  std::string velocity(AxisId axis, double value) const {
    if (value == 0.0) return "";
    return fmt::format(", velocity {} {}/s", numberText(value), unit(axis));
  }
  std::string move(const MoveTo& wanted) const {
    return fmt::format("{} {} {} {}{}", name(wanted.axis), wanted.relative ? "by" : "to",
                       numberText(wanted.position), unit(wanted.axis),
                       velocity(wanted.axis, wanted.velocity));
  }

  const std::vector<config::AxisConfig>& axes_;
};

}  // namespace

std::string textOf(const Request& request, const std::vector<config::AxisConfig>& axes) {
  return std::visit(RequestText(axes), request);
}

const char* textOf(pulse::EndReason reason) {
  switch (reason) {
    case pulse::EndReason::kDone:
      return "reached its end";
    case pulse::EndReason::kEndstopMin:
      return "met the min endstop";
    case pulse::EndReason::kEndstopMax:
      return "met the max endstop";
    case pulse::EndReason::kEmergencyStop:
      return "was ended by an emergency stop";
    case pulse::EndReason::kChipFault:
      return "was ended by a fault of the driver chip";
    case pulse::EndReason::kTooLate:
      return "was ended because a pulse was too late";
    case pulse::EndReason::kLineError:
      return "was ended by a line that failed";
    case pulse::EndReason::kNotInPosition:
      return "was not in position in time after its end";
    case pulse::EndReason::kSkewed:
      return "was ended because its motors got too far apart";
    case pulse::EndReason::kCompanion:
      return "was ended together with another axis";
  }
  return "ended";
}

}  // namespace stepdriver::machine
