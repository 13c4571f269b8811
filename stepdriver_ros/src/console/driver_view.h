#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

/// What an axis of the driver is and does, in the units of configurations: mm or degrees.
struct AxisView {
  std::string name;
  bool enabled = false;
  bool asleep = false;
  bool idle = false;
  bool moving = false;
  bool held = false;
  bool homed = false;
  bool position_valid = false;
  int microsteps = 1;
  double position = 0.0;  ///< [mm|deg]
  double velocity = 0.0;  ///< [mm/s|deg/s]
  std::string fault;      ///< empty: none
  std::string position_note;
  bool switches_known = false;  ///< no: the two below say nothing
  bool min_active = false;
  bool max_active = false;
};

/// What the console knows of the driver: how its axes are configured, and what it said last. It
/// knows no clock: times are seconds on any that never goes back.
class DriverView {
 public:
  /// A state older than this is no news any more: the driver publishes it ten times a second.
  static constexpr double kStaleAfter = 1.0;  // [s]

  /// @param configs of all axes, as the driver reads them.
  void configure(std::vector<config::AxisConfig> configs) { configs_ = std::move(configs); }
  /// @param axes all that the driver has.
  void update(std::vector<AxisView> axes, double now);
  /// The switches of one axis, which come by themselves.
  void updateEndstops(const std::string& axis, bool min_active, bool max_active);
  /// They come on their changes only, so that those of a driver that has gone say nothing.
  void forgetEndstops();

  const std::vector<AxisView>& axes() const { return axes_; }
  /// @return nullptr where there is no such axis.
  const AxisView* axis(const std::string& name) const;
  const config::AxisConfig* config(const std::string& name) const;
  /// Whether each axis has a configuration, and each configuration its axis.
  bool configured() const;

  /// [s] since the last state; none: there was none yet.
  std::optional<double> age(double now) const;
  bool live(double now) const;
  /// How many states there were so far.
  int updates() const { return updates_; }
  bool anyFault() const;
  bool anyMoving() const;

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
  std::optional<double> updated_;
  int updates_ = 0;
};

/// [mm|deg] that one step of the axis moves it, in the microstep mode of now.
double stepOf(const config::AxisConfig& config, const AxisView& axis);

/// `mm` or `deg`.
inline const char* unitOf(config::Kind kind) {
  return kind == config::Kind::kLinear ? "mm" : "deg";
}

}  // namespace stepdriver::console
