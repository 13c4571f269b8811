#pragma once

#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/pulse/pulse_engine.h"

namespace stepdriver::axis {

/// What to write to a chip's pins, and how long to wait after each, to have it do something.
class ChipPins {
 public:
  /// @param config outlives the pins.
  ChipPins(const AxisConfig& config, const AxisLines& lines);

  bool hasEnable() const { return lines_.enable >= 0; }
  bool hasSleep() const { return lines_.sleep >= 0; }
  bool hasReset() const { return lines_.reset >= 0; }
  bool hasMode() const { return lines_.mode[0] >= 0; }

  /// From the safe levels to awake and out of reset. Empty where neither pin is wired.
  pulse::PinSequence bringUp() const;
  pulse::PinSequence enable(bool on) const;
  pulse::PinSequence sleep(bool asleep) const;
  pulse::PinSequence reset() const;
  /// One pin at a time, over defined codes only.
  pulse::PinSequence mode(int from_microsteps, int to_microsteps) const;
  /// STEP inactive, and the other pins as they should be, whatever they are.
  pulse::PinSequence restore(bool enabled, bool asleep) const;

 private:
  const AxisConfig& config_;
  const chip::Chip& chip_;
  const AxisLines lines_;
};

}  // namespace stepdriver::axis
