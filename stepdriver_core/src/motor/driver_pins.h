#pragma once

#include <functional>
#include <vector>

#include "motor_lines.h"
#include "pin_sequence.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::motor {

/// The writes to the pins of the chips of an axis, with the wait after each, that carry out an
/// operation of all of them. Pins of the same name are written one after the other, without a wait
/// between them.
class DriverPins {
 public:
  /// Whether an ENABLE line, by its index, needs to be written.
  using Lines = std::function<bool(int line)>;

  /// @param config outlives the pins.
  DriverPins(const config::AxisConfig& config, const MotorLines& lines);

  /// @name If one chip of the axis has the pin wired, all have
  /// @{
  /// Lines switch the current: ENABLE, or those of the coils.
  bool hasEnable() const { return lines_.enable >= 0 || lines_.hasCoils(); }
  bool hasSleep() const { return lines_.sleep >= 0; }
  /// @}
  /// Whether any of the chips has it wired.
  bool hasReset() const;
  /// Whether the mode pins are wired; only an axis with one motor changes its mode.
  bool hasMode() const { return lines_.mode[0] >= 0; }

  /// Wakes the chips and releases them from reset, starting at the safe levels. Empty if neither
  /// pin is wired.
  PinSequence bringUp() const;
  /// @param written tells which lines to write.
  PinSequence enable(bool on, const Lines& written) const;
  PinSequence sleep(bool asleep) const;
  PinSequence reset() const;
  /// One pin at a time, through defined codes only.
  PinSequence mode(int from_microsteps, int to_microsteps) const;
  /// Sets STEP inactive and the other pins to their intended levels, whatever their present levels
  /// are. @param enabled tells which ENABLE lines to assert.
  PinSequence restore(const Lines& enabled, bool asleep) const;

 private:
  const config::AxisConfig& config_;
  const MotorLines lines_;
};

}  // namespace stepdriver::motor
