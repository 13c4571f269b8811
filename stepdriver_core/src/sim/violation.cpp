#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

const char* nameOf(Violation violation) {
  switch (violation) {
    case Violation::kShortStepHigh:
      return "short step high";
    case Violation::kShortStepLow:
      return "short step low";
    case Violation::kDirSetup:
      return "direction set too late before a step";
    case Violation::kDirHold:
      return "direction changed too soon after a step";
    case Violation::kModeSetup:
      return "microstep pins set too late before a step";
    case Violation::kModeHold:
      return "microstep pins changed too soon after a step";
    case Violation::kUndefinedMode:
      return "undefined microstep code";
    case Violation::kStepWhileDisabled:
      return "step while disabled";
    case Violation::kStepAfterEnable:
      return "step too soon after enable";
    case Violation::kStepWhileAsleep:
      return "step while asleep";
    case Violation::kStepAfterWake:
      return "step too soon after wake-up";
    case Violation::kStepInReset:
      return "step in reset or too soon after it";
    case Violation::kUndefinedPattern:
      return "coils that no step has together";
    case Violation::kPatternJump:
      return "jump of the pattern of coils";
    case Violation::kCoilLeftOn:
      return "coil left on";
    case Violation::kBothInputs:
      return "pulses on CW and CCW at the same time";
    case Violation::kStepIntoSwitch:
      return "step into an active switch";
    case Violation::kStepAgainstBrake:
      return "step against the brake";
    case Violation::kStepWithoutPower:
      return "step while the motor power is off";
    case Violation::kAboveTopRate:
      return "steps above the top speed";
    case Violation::kAboveAcceleration:
      return "speed changed faster than the acceleration";
  }
  return "unknown violation";
}

std::int64_t RigAxisReport::totalViolations() const {
  std::int64_t total = 0;
  for (const auto& [violation, count] : violations) total += count;
  return total;
}

}  // namespace stepdriver::sim
