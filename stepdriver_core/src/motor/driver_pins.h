#pragma once

#include "motor_lines.h"
#include "pin_sequence.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::motor {

/// The writes to a chip's pins, with the wait after each, that carry out an operation of the chip.
class DriverPins {
 public:
  /// @param config outlives the pins.
  DriverPins(const config::AxisConfig& config, const MotorLines& lines);

  bool hasEnable() const { return lines_.enable >= 0; }
  bool hasSleep() const { return lines_.sleep >= 0; }
  bool hasReset() const { return lines_.reset >= 0; }
  bool hasMode() const { return lines_.mode[0] >= 0; }

  /// Wakes the chip and releases it from reset, starting at the safe levels. Empty if neither pin
  /// is wired.
  PinSequence bringUp() const;
  PinSequence enable(bool on) const;
  PinSequence sleep(bool asleep) const;
  PinSequence reset() const;
  /// One pin at a time, through defined codes only.
  PinSequence mode(int from_microsteps, int to_microsteps) const;
  /// Sets STEP inactive and the other pins to their intended levels, whatever their present levels
  /// are.
  PinSequence restore(bool enabled, bool asleep) const;

 private:
  const config::AxisConfig& config_;
  const MotorLines lines_;
};

}  // namespace stepdriver::motor
