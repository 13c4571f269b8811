#include "node_config.h"

#include "config/config_reader.h"
#include "setup/read_machine_config.h"

namespace stepdriver::ros_node {
namespace {

constexpr config::Range kJointStateRates{1.0, 1000.0};
constexpr config::Range kJogTimeouts{0.02, 60.0};
constexpr config::Range kSetpointTimeouts{0.02, 60.0};

NodeConfig readKeys(config::ConfigReader& reader) {
  NodeConfig config;
  static_cast<setup::MachineConfig&>(config) = setup::readMachineConfig(reader);
  config.joint_state_rate =
      reader.number("joint_state_rate", kJointStateRates, config.joint_state_rate);
  config.jog_timeout = reader.number("jog_timeout", kJogTimeouts, config.jog_timeout);
  config.urdf_limits = reader.boolean("urdf_limits", config.urdf_limits);
  config.publish_clock = reader.boolean("publish_clock", config.publish_clock);
  if (config.publish_clock && config.backend != setup::GpioBackend::kSimulated) {
    reader.contradiction(
        "publish_clock",
        "is true, but gpio/backend is libgpiod, so that the clock is the computer's; only "
        "the simulated rig has a time of its own");
  } else if (config.publish_clock && config.simulation.speed == 0.0) {
    reader.contradiction(
        "publish_clock",
        "is true, but simulation/speed is 0, and then time stands still while nothing "
        "moves; give a speed above 0");
  }
  config.stop_on_master_lost =
      reader.oneOf("on_master_lost", {"continue", "stop"}, "continue") == "stop";
  config::ConfigReader trajectory = reader.map("trajectory");
  config.allow_slower = trajectory.boolean("allow_slower", config.allow_slower);
  trajectory.rejectUnknown();
  config::ConfigReader setpoint = reader.map("setpoint");
  if (setpoint.oneOf("mode", {"position", "velocity"}, "position") == "velocity") {
    config.setpoint_mode = machine::SetpointMode::kVelocity;
  }
  config.setpoint_timeout = setpoint.number("timeout", kSetpointTimeouts, config.setpoint_timeout);
  setpoint.rejectUnknown();
  config.hardware_id = reader.text("hardware_id", config.hardware_id);
  return config;
}

}  // namespace

NodeConfig readNodeConfig(const config::ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues) {
  config::ConfigReader reader(tree, name, issues);
  NodeConfig config = readKeys(reader);
  reader.rejectUnknown();
  return config;
}

std::vector<std::string> parameterNames() {
  const config::ConfigValue nothing = config::ConfigValue::Map{};
  std::vector<ConfigIssue> issues;
  config::ConfigReader reader(nothing, "", issues);
  readKeys(reader);
  return reader.known();
}

}  // namespace stepdriver::ros_node
