#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "config/used_lines.h"
#include "stepdriver_core/machine/machine.h"

/// Readers of the keys of a configuration that become MachineOptions.
namespace stepdriver::machine {

/// Reads `write_timeout_ms` of `gpio` [s].
double readWriteTimeout(config::ConfigReader& gpio, double otherwise);

/// Reads `max_lateness_ms` of `realtime` [s].
double readMaxLateness(config::ConfigReader& realtime, double otherwise);

/// Reads `late_steps` of `realtime` [full steps].
double readLateSteps(config::ConfigReader& realtime, double otherwise);

/// Reads `cpu` of `realtime`.
std::optional<int> readProcessor(config::ConfigReader& realtime);

/// Reads `seconds` and `memory_mb` of `recorder`.
void readRecorderSize(config::ConfigReader& recorder, double& seconds, double& memory_mb);

/// Reads `state_file`, or another key with a path.
///
/// @param otherwise what an empty path means.
std::string readAbsolutePath(config::ConfigReader& reader, const std::string& key,
                             const std::string& fallback, const char* otherwise);

/// Read the map of that name, if there is one.
std::optional<HeartbeatConfig> readHeartbeat(config::ConfigReader& machine,
                                             config::UsedLines& used);
std::optional<config::MotorPowerConfig> readMotorPower(config::ConfigReader& machine,
                                                       config::UsedLines& used);

/// Reads `emergency_stop`.
///
/// @param axes nullptr: they have issues, and nothing that depends on them is checked.
void readEmergencyStop(config::ConfigReader& machine, const std::vector<config::AxisConfig>* axes,
                       bool has_motor_power, EmergencyDisable& disable,
                       std::optional<config::InputSwitch>& button, config::UsedLines& used);

/// Checks axes and options that a program has made itself, by the rules of a configuration file.
///
/// @throw ConfigError with all issues.
void checkConfiguration(const std::vector<config::AxisConfig>& axes, const MachineOptions& options);

}  // namespace stepdriver::machine
