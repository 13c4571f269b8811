#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "axis/line_names.h"
#include "motor/motor_lines.h"
#include "shell.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::axis {

/// What an axis needs to be as its clients see it: each command is a request to the controller;
/// readers use the last snapshot and the engine's count.
struct Axis::Impl {
  const config::AxisConfig config;
  const machine::AxisId id;
  const motor::MotorLines motor_lines;
  machine::Shell& shell;  // this and the following outlive the axis
  gpio::Lines& lines;
  const LineNames& names;

  activity::Reply ask(machine::Request request) const;
  std::optional<MoveResult> result(const Move& move) const;
  void requireAccepted(const Move& move) const;
  std::optional<bool> endstopActive(bool at_max) const;
};

}  // namespace stepdriver::axis

namespace stepdriver::machine {

/// Returns a successful answer. @throw Refused, GpioError, Error
activity::Reply valueOf(activity::Reply reply);

/// Has a request carried out. @return its answer. @throw as valueOf()
activity::Reply ask(Shell& shell, Request request);

/// Homes axes simultaneously, and returns when all have ended.
std::vector<axis::HomingResult> homeTogether(Shell& shell, const std::vector<AxisId>& axes,
                                             const std::function<bool()>& cancelled);

/// Homes axes by HomingConfig::order. If one fails, those that come later aren't homed.
///
/// @param all of the machine. @param wanted those to home.
std::vector<axis::HomingResult> homeInOrder(Shell& shell,
                                            const std::vector<std::unique_ptr<axis::Axis>>& all,
                                            const std::vector<AxisId>& wanted,
                                            const std::function<bool()>& cancelled);

}  // namespace stepdriver::machine
