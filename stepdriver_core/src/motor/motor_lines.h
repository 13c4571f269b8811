#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "channel/channel_config.h"
#include "enable_line.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::motor {

/// The indices of the lines of a motor in the request for all axes. -1: not wired.
struct ChipLines {
  int step = -1;
  int dir = -1;
  int enable = -1;
  std::shared_ptr<EnableLine> enable_line;  ///< the line of `enable`, which other motors may share
  std::array<int, 3> mode = {-1, -1, -1};
  int sleep = -1;
  int reset = -1;
  int endstop_min = -1;
  int endstop_max = -1;
  int fault = -1;
  int in_position = -1;
  std::array<int, pulse::kCoils> coils = {-1, -1, -1, -1};
};

/// An input with a name that an axis uses, without being its owner.
struct SensorLine {
  pulse::Signal signal;
  pulse::Nanoseconds debounce = 0;  ///< a level must stay for so long to count
};

/// The lines of an axis: those of its first motor, and all others.
struct MotorLines : ChipLines {
  std::vector<ChipLines> twins;
  int brake = -1;
  bool cw_ccw = false;                     ///< `step` is CW, and `dir` is CCW
  std::optional<SensorLine> homing_input;  ///< of HomingConfig::input
  std::optional<SensorLine> homing_flag;   ///< of HomingConfig::flag

  /// Its motors have coils that are switched by lines.
  bool hasCoils() const { return coils.front() >= 0; }
  std::size_t motors() const { return 1 + twins.size(); }
  const ChipLines& motorAt(std::size_t index) const {
    return index == 0 ? *this : twins[index - 1];
  }
};

/// Adds the lines of an axis to a request. Safe levels: no pulse, disabled, asleep, in reset, and
/// the configured microstep mode, and the brake engaged. An axis that stays enabled after a
/// shutdown keeps its chips awake.
///
/// @param others the axes that are already in the request: their ENABLE lines can be shared.
MotorLines requestLines(const config::AxisConfig& config, const std::vector<MotorLines>& others,
                        std::vector<gpio::OutputRequest>& outputs,
                        std::vector<gpio::InputRequest>& inputs);

/// The axis as the pulse engine sees it.
pulse::ChannelConfig channelConfig(const config::AxisConfig& config, const MotorLines& lines);

}  // namespace stepdriver::motor
