#pragma once

#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::config {

/// The allowed range of a number; bounds are included unless stated otherwise.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_excluded = false;

  static Range positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
  static Range notNegative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }

  /// False for NaN, whatever the bounds.
  bool holds(double number) const;
};

/// Whether a missing key is an issue.
enum class Presence { kRequired, kOptional };

/// Reads one map of a configuration strictly: types are exact (an int is accepted for a double,
/// nothing else is converted), numbers are finite, unknown keys are errors. It collects every issue
/// under the full name of the parameter, and never throws because of what it reads.
///
/// If a value is wrong, the reader returns the default; the caller checks the issues before it uses
/// anything. To compute something from several values, use the find...() functions: they tell right
/// values from wrong ones, so that one mistake gives one message. A reader of something that isn't
/// a map reports this once, and nothing else.
class ConfigReader {
 public:
  /// @param value the map; if it isn't one, that is the first issue. Outlives the reader.
  /// @param name full name of the map, such as `/stepdriver/axes/x`.
  /// @param issues collects the issues; outlives the reader.
  ConfigReader(const ConfigValue& value, std::string name, std::vector<ConfigIssue>& issues);
  ConfigReader(ConfigValue&&, std::string, std::vector<ConfigIssue>&) = delete;

  /// False if the value isn't a map, which has been reported.
  bool isMap() const { return map_ != nullptr; }
  bool has(const std::string& key) const;
  /// The value of a key as messages show it.
  std::string shown(const std::string& key) const;
  /// The value of a key as it was written; nothing if there is no such key.
  const ConfigValue& value(const std::string& key) const;
  /// @param key empty: the map itself.
  std::string fullName(const std::string& key) const;

  /// @name Values of keys. The key may be missing if there is a default; otherwise that is an
  ///   issue.
  /// @{
  double number(const std::string& key, const Range& range, std::optional<double> fallback = {});
  int integer(const std::string& key, int min, int max, std::optional<int> fallback = {});
  bool boolean(const std::string& key, std::optional<bool> fallback = {});
  std::string text(const std::string& key, const std::optional<std::string>& fallback = {});
  std::string oneOf(const std::string& key, const std::vector<std::string>& allowed,
                    const std::optional<std::string>& fallback = {});
  /// @}

  /// @name Empty if the key is missing, or if its value is wrong, which is an issue.
  /// @{
  std::optional<double> findNumber(const std::string& key, const Range& range, Presence presence);
  std::optional<int> findInteger(const std::string& key, int min, int max, Presence presence);
  /// @param hint follows the allowed values in a message.
  std::optional<int> findOneOf(const std::string& key, const std::vector<int>& allowed,
                               Presence presence, const std::string& hint = "");
  std::optional<bool> findBoolean(const std::string& key, Presence presence);
  /// A text with control characters is an issue: it could forge a line of a log.
  ///
  /// @param wanted describes the required text, for messages.
  std::optional<std::string> findText(const std::string& key, Presence presence,
                                      const std::string& wanted = "a string");
  std::optional<std::string> findOneOf(const std::string& key,
                                       const std::vector<std::string>& allowed, Presence presence);
  /// @}

  /// The keys of the map, in their order. They are not known by that.
  std::vector<std::string> keys() const;

  /// A map below this one; an empty one if the key is missing.
  ConfigReader map(const std::string& key);

  /// @param key empty: the issue is with the map itself.
  /// @param message continues the sentence that the name of the parameter begins.
  void issue(const std::string& key, const std::string& message);

  /// Reports a key that should not be there, or that contradicts another one.
  void contradiction(const std::string& key, const std::string& message);

  /// All issues so far, also those of other readers.
  std::vector<ConfigIssue>& issues() const { return issues_; }

  /// Accepts a key as known although nothing reads its value.
  void allow(const std::string& key);

  /// The keys that may be there, because something has read or allowed them.
  std::vector<std::string> known() const { return {known_.begin(), known_.end()}; }

  /// Reports every key of the map that nothing has read, with the one that may be meant. The first
  /// of those that resemble none comes with all known ones.
  void rejectUnknown();

 private:
  ConfigReader(const ConfigValue::Map* map, std::string name, std::vector<ConfigIssue>& issues);

  /// @return nullptr if there is no such key; that is an issue if the key is required.
  const ConfigValue* find(const std::string& key, Presence presence, const std::string& wanted);
  void wrong(const std::string& key, const std::string& is, const std::string& wanted);

  std::string name_;
  const ConfigValue::Map* map_;  ///< nullptr: not a map, and reported as such
  std::vector<ConfigIssue>& issues_;
  std::set<std::string> known_;
};

/// Reports a map whose name no axis can have, because the name becomes part of ROS names.
void checkAxisName(const std::string& name, ConfigReader& axis);

/// Reads the map of axes.
///
/// @code{.yaml}
/// axes:
///   x:                          # [a-zA-Z][a-zA-Z0-9_]*
///     driver: a4988             # a name of driverChipNames(), or step_dir: see `chip`
///     joint: x_joint            # default: the axis's name
///     pins:                     # `chip:offset` or the name of a line; each once, except enable
///       step: "gpiochip0:17"
///       dir: "gpiochip0:27"
///       enable: "gpiochip0:22"  # optional, like all pins below
///       ms1: "gpiochip0:5"      # all microstep pins or none; m0 to m2 on a drv8825 or drv8434
///       ms2: "gpiochip0:6"
///       ms3: "gpiochip0:13"
///       sleep: "gpiochip0:19"   # on drivers that have it
///       reset: "gpiochip0:26"   # on drivers that have it
///     fault_bias: as_is         # of pins/fault
///     fault_stop: at_once       # or ramp: how a fault of the driver ends a motion
///     in_position_bias: as_is   # of pins/in_position
///     in_position_timeout_ms: 1000.0  # it must become active within this time after a motion
///     invert: {dir: true}       # of wired pins; default: false
///     common_anode: false       # optocouplers: step, dir and enable inverted; then only dir in
///                               # `invert`
///     microsteps: 16
///     # two ways to scale the axis; `degree` and `deg` instead of `mm` on a rotary axis:
///     steps_per_mm: 80.0        # [microsteps/mm] at `microsteps`; steps_per_degree
///     # or
///     full_steps_per_round: 200
///     mm_per_round: 40.0        # [mm] per revolution of the gear's output; linear axes only
///     wheel_diameter_mm: 65.0   # instead of mm_per_round
///     gear_ratio: 1.0           # motor revolutions per revolution of the gear's output
///     # end of the two ways
///     steps_per_round: 3200     # [microsteps] per motor revolution; has a default
///     max_speed_mm_s: 100.0     # max_speed_deg_s, and so on
///     start_speed_mm_s: 0.0     # reached without a ramp; default: 0
///     acceleration_mm_s2: 500.0
///     deceleration_mm_s2: 500.0 # default: the acceleration
///     backlash_mm: 0.0          # travel that a reversal loses; default: 0
///     input_shaper:             # or a list of such maps; default: motions aren't shaped
///       {type: mzv, frequency: 42.0, damping: 0.1}  # zv, mzv, ei or 2hump_ei; frequency: [Hz],
///                                                   # or a list
///     min_position_mm: 0.0      # default: no limit
///     max_position_mm: 200.0
///     endstops:                 # both optional
///       min: {pin: "gpiochip0:20", active_level: low}   # low or high
///       max: {pin: "gpiochip0:21", active_level: low, shared: false}  # true: also others' line
///       release_mm: 2.0         # only if both share one line: on this way it opens for certain
///       assumed_end: min        # the end that presses it if nothing tells; default: refused then
///     motors:                   # 2 to 4 that step together, in place of pins and endstops above:
///       left: {pins: ..., endstops: ..., offset_mm: 0.0}  # and all keys about them; and driver,
///                               # chip and timing, if they aren't those of the axis
///     max_skew_mm: 5.0          # how far they may get apart while a homing squares them
///     brake:                    # default: no brake; needs pins/enable or pins/sleep
///       {pin: "gpiochip0:12", release_level: high, release_ms: 60.0, engage_ms: 30.0}
///     chip:                     # each overrides the named chip's
///       {step_inputs: step_dir,   # or cw_ccw: the pins are cw and ccw instead of step and dir
///        step_edges: one,          # or both: each edge of step is a step
///        step_active: high, enable_active: low, sleep_active: low, reset_active: none,
///        fault_active: none, fault_ended_by: power, in_position_active: none, when_disabled: held,
///        when_asleep: home,
///        microstep_codes: "1 LLL, 2 HLL"}
///     timing:                   # each overrides the chip's
///       {step_high_us: 1.0, step_low_us: 1.0, dir_setup_us: 0.2, dir_hold_us: 0.2,
///        mode_setup_us: 0.2, mode_hold_us: 0.2, enable_ms: 0.0, wake_ms: 1.0,
///        reset_low_ms: 1.0, reset_wait_ms: 10.0}
///     enable_on_start: false
///     disable_on_shutdown: true
///     align_on_microstep_change: false
///     idle_timeout_s: 0.0       # time at rest until the idle action; 0: never
///     idle_action: disable      # or sleep
///     holds_position_unpowered: false
/// @endcode
///
/// @param name full name of the map, such as `/stepdriver/axes`.
/// @param issues every mistake is added here.
/// @return the axes in the order of their names; to be used only if no issue was added.
std::vector<AxisConfig> readAxes(const ConfigValue& axes, const std::string& name,
                                 std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::config
