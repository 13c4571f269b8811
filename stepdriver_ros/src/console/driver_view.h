#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// The state of an axis of the driver, in the units of configurations: mm or degrees.
struct AxisView {
  std::string name;
  bool enabled = false;
  bool powered = true;  ///< the power of the motors is there
  bool asleep = false;
  bool idle = false;
  bool moving = false;
  bool held = false;
  bool homed = false;
  bool position_valid = false;
  int microsteps = 1;
  double position = 0.0;  ///< [mm|deg]
  double velocity = 0.0;  ///< [mm/s|deg/s]
  double speed_override = 1.0;
  std::string fault;  ///< empty: none
  std::string position_note;
  bool switches_known = false;  ///< false: the two below are meaningless
  bool min_active = false;
  bool max_active = false;
};

/// The state of an output with a name.
struct OutputView {
  std::string name;
  bool on = false;
  std::optional<double> changed;  ///< [s] when it was switched; empty: not since the start
  std::string note;               ///< why it was switched off by itself
  std::string error;              ///< why `on` isn't certain
  std::string axis = {};          ///< whose position switches it; empty: none does
  std::uint64_t compared = 0;     ///< what positions have made it do
  std::uint64_t missed = 0;       ///< what they could not
  double value = 1.0;             ///< while it is on: below 1, a PWM output is on in part
};

/// The state of an input with a name.
struct InputView {
  std::string name;
  bool active = false;
  std::optional<double> changed;  ///< [s] when its level changed; empty: not since the start
  std::string error;              ///< why it can't be read
};

/// What the console knows about the driver: the configuration of its axes, and their last state. It
/// has no clock: times are seconds on any clock that never goes back.
class DriverView {
 public:
  /// A state older than this is stale: the driver publishes it ten times a second.
  static constexpr double kStaleAfter = 1.0;  // [s]

  /// @param configs of all axes, read like the driver reads them.
  void configure(std::vector<config::AxisConfig> configs) { configs_ = std::move(configs); }
  /// @param axes all axes of the driver.
  void update(std::vector<AxisView> axes, double now);
  /// The switches of one axis, which come in a message of their own.
  void updateEndstops(const std::string& axis, bool min_active, bool max_active);
  /// What the driver chips of an axis say, in words; they come in a message of their own.
  void updateChips(const std::string& axis, const std::string& text) { chips_[axis] = text; }
  /// Switches are published only when they change, so those of a driver that has gone are
  /// meaningless, and what its chips have said as well.
  void forgetEvents();

  /// The outputs and inputs with a name, which come at each change.
  void updateIo(std::vector<OutputView> outputs, std::vector<InputView> inputs);

  const std::vector<OutputView>& outputs() const { return outputs_; }
  const std::vector<InputView>& inputs() const { return inputs_; }
  const std::vector<AxisView>& axes() const { return axes_; }
  /// @return nullptr if there is no such axis.
  const AxisView* axis(const std::string& name) const;
  const config::AxisConfig* config(const std::string& name) const;
  /// Whether each axis has a configuration, and each configuration its axis.
  bool configured() const;

  /// [s] since the last state; empty: there was no state yet.
  std::optional<double> age(double now) const;
  bool live(double now) const;
  /// The number of states so far.
  int updates() const { return updates_; }
  bool anyFault() const;
  /// Empty: the axis has no chip that says anything.
  std::string chipsOf(const std::string& axis) const;

 private:
  struct Switches {
    std::string axis;
    bool min_active = false;
    bool max_active = false;
  };
  void takeSwitches(AxisView& axis) const;

  std::vector<config::AxisConfig> configs_;
  std::vector<AxisView> axes_;
  std::vector<Switches> switches_;
  std::vector<OutputView> outputs_;
  std::vector<InputView> inputs_;
  std::map<std::string, std::string> chips_;  // by axis
  std::optional<double> updated_;
  int updates_ = 0;
};

/// [mm|deg] Travel of one step of the axis in the current microstep mode.
double stepOf(const config::AxisConfig& config, const AxisView& axis);

/// The unit of configurations, which the console shows: `mm` or `deg`.
inline const char* configUnitOf(config::Kind kind) {
  return kind == config::Kind::kLinear ? "mm" : "deg";
}

}  // namespace stepdriver::console
