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

namespace stepdriver::machine {

/// An axis as its clients see it: each command is a request to the controller; readers use the last
/// snapshot and the engine's count.
class MachineAxis : public axis::Axis {
 public:
  /// @param shell, lines, names outlive the axis.
  MachineAxis(config::AxisConfig config, AxisId id, const motor::MotorLines& motor_lines,
              Shell& shell, gpio::Lines& lines, const axis::LineNames& names);

  AxisId id() const { return id_; }

  const config::AxisConfig& config() const override { return config_; }
  axis::Move moveTo(double position, bool relative, double velocity, bool shortest) override;
  axis::MovePlan plan(double position, bool relative, double velocity, bool shortest) override;
  axis::Move moveRounds(double rounds, double velocity) override;
  std::optional<axis::MoveResult> result(const axis::Move& move) const override;
  axis::MoveResult wait(const axis::Move& move) override;
  std::optional<axis::MoveResult> waitFor(const axis::Move& move,
                                          std::chrono::nanoseconds longest) override;
  void jog(double velocity, std::optional<std::uint64_t> unless_stopped_since) override;
  void setLimits(const axis::AxisLimits& wanted) override;
  axis::AxisLimits limits() const override;
  void setCurrent(double run, double hold) override;
  void stop() override;
  void stop(const axis::Move& move) override;
  axis::HomingResult home(const std::function<bool()>& cancelled) override;
  void checkHoming() const override;
  void enable(bool on) override;
  void sleep(bool asleep) override;
  void reset() override;
  void setMicrosteps(int microsteps) override;
  void setPosition(double position) override;
  axis::AxisState state() const override;
  double peakRate() const override;
  axis::EndstopState endstops() const override;

 private:
  void requireAccepted(const axis::Move& move) const;
  std::optional<bool> endstopActive(bool at_max) const;

  const config::AxisConfig config_;
  const AxisId id_;
  const motor::MotorLines motor_lines_;
  Shell& shell_;
  gpio::Lines& lines_;
  const axis::LineNames& names_;
};

/// Returns a successful answer. @throw Refused, GpioError, Error
activity::Reply valueOf(activity::Reply reply);

/// Has a request carried out. @return its answer. @throw as valueOf()
activity::Reply ask(Shell& shell, Request request);

/// Homes axes simultaneously, and returns when all have ended.
std::vector<axis::HomingResult> homeTogether(Shell& shell, const std::vector<AxisId>& axes,
                                             const std::function<bool()>& cancelled);

/// Homes axes by HomingConfig::order. If one fails, those that come later aren't homed.
std::vector<axis::HomingResult> homeInOrder(Shell& shell, const std::vector<MachineAxis*>& axes,
                                            const std::function<bool()>& cancelled);

}  // namespace stepdriver::machine
