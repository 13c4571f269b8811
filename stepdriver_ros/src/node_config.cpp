#include "node_config.h"

#include <utility>

#include "stepdriver_core/axis/config_reader.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/pulse/cpu_latency.h"

namespace stepdriver::ros_node {
namespace {

using axis::ConfigReader;
using axis::ConfigValue;
using axis::Range;

constexpr Range kJointStateRates{1.0, 1000.0};
constexpr Range kJogTimeouts{0.02, 60.0};
constexpr double kLongestLatenessMs = 1000.0;

GpioBackend readGpio(ConfigReader gpio) {
  const std::string backend = gpio.oneOf("backend", {"simulated", "libgpiod"});
  if (backend == "libgpiod" && gpio::libgpiodVersion().empty()) {
    gpio.issue(
        "backend",
        "is \"libgpiod\", but stepdriver was built without it, so that it must be simulated; "
        "install libgpiod-dev and build again for real lines");
  }
  gpio.rejectUnknown();
  return backend == "libgpiod" ? GpioBackend::kLibgpiod : GpioBackend::kSimulated;
}

const std::vector<std::string> kPolicies = {"warn", "enforce"};

void readRealtime(ConfigReader realtime, NodeConfig& config) {
  config.enforce_realtime = realtime.oneOf("policy", kPolicies, "warn") == "enforce";
  const double milliseconds = realtime.number(
      "max_lateness_ms", Range{0.0, kLongestLatenessMs, true}, config.max_lateness * 1e3);
  config.max_lateness = milliseconds * 1e-3;
  config.keep_cpus_awake = realtime.boolean("keep_cpus_awake", config.keep_cpus_awake);
  realtime.rejectUnknown();
}

const ConfigValue& valueOf(const ConfigValue& tree, const std::string& key) {
  static const ConfigValue nothing;
  const auto* map = tree.as<ConfigValue::Map>();
  const auto found = map != nullptr ? map->find(key) : ConfigValue::Map::const_iterator{};
  return map != nullptr && found != map->end() ? found->second : nothing;
}

}  // namespace

std::string latencyDevice(const NodeConfig& config) {
  return config.keep_cpus_awake ? pulse::CpuLatencyHold::kDevice : "";
}

NodeConfig readNodeConfig(const ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues) {
  NodeConfig config;
  ConfigReader reader(tree, name, issues);
  config.backend = readGpio(reader.map("gpio"));
  config.joint_state_rate =
      reader.number("joint_state_rate", kJointStateRates, config.joint_state_rate);
  config.jog_timeout = reader.number("jog_timeout", kJogTimeouts, config.jog_timeout);
  config.hardware_id = reader.text("hardware_id", config.hardware_id);
  config.state_file = reader.text("state_file", config.state_file);
  if (!config.state_file.empty() && config.state_file[0] != '/') {
    reader.issue("state_file", "is " + reader.shown("state_file") +
                                   ", but must be an absolute path, or empty for none");
  }
  if (valueOf(tree, "realtime").as<std::string>() != nullptr) {
    config.enforce_realtime = reader.oneOf("realtime", kPolicies) == "enforce";
  } else {
    readRealtime(reader.map("realtime"), config);
  }

  const std::size_t issues_before = issues.size();
  reader.allow("axes");
  axis::UsedLines used(issues);
  config.axes = axis::readAxes(valueOf(tree, "axes"), reader.fullName("axes"), issues, used);
  const bool axes_are_right = issues.size() == issues_before;
  config.emergency_stop = axis::readInputSwitch(reader, "emergency_stop", used);
  ConfigReader simulation = reader.map("simulation");
  if (simulation.has("emergency_stop") && !reader.has("emergency_stop")) {
    simulation.issue("emergency_stop", "is " + simulation.shown("emergency_stop") + ", but " +
                                           reader.fullName("emergency_stop") + " is missing");
  }
  config.simulation = readSimulation(std::move(simulation), config.axes, axes_are_right);
  if (config.backend == GpioBackend::kLibgpiod && !config.simulation.trace.empty()) {
    issues.push_back({reader.fullName("simulation/trace"),
                      "is \"" + config.simulation.trace +
                          "\", but only the simulated rig has a trace, and gpio/backend is "
                          "libgpiod; leave it out or empty"});
  }
  reader.rejectUnknown();
  return config;
}

}  // namespace stepdriver::ros_node
