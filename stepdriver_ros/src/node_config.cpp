#include "node_config.h"

#include "stepdriver_core/axis/config_reader.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::ros_node {
namespace {

using axis::ConfigReader;
using axis::ConfigValue;
using axis::Range;

constexpr Range kJointStateRates{1.0, 1000.0};
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

const ConfigValue& valueOf(const ConfigValue& tree, const std::string& key) {
  static const ConfigValue nothing;
  const auto* map = tree.as<ConfigValue::Map>();
  const auto found = map != nullptr ? map->find(key) : ConfigValue::Map::const_iterator{};
  return map != nullptr && found != map->end() ? found->second : nothing;
}

/// The policy by itself, or a map that may have it.
void readRealtime(ConfigReader& reader, const ConfigValue& value, NodeConfig& config) {
  const std::vector<std::string> policies{"warn", "enforce"};
  std::string policy = policies.front();
  if (value.as<std::string>() != nullptr) {
    policy = reader.oneOf("realtime", policies);
  } else if (!value.isNothing() && value.as<ConfigValue::Map>() == nullptr) {
    reader.allow("realtime");
    reader.issue("realtime", "is " + value.shown() + ", but must be warn, enforce or a map");
  } else {
    ConfigReader map = reader.map("realtime");
    policy = map.oneOf("policy", policies, policy);
    config.max_lateness = map.number("max_lateness_ms", Range{0.0, kLongestLatenessMs, true},
                                     config.max_lateness * 1e3) *
                          1e-3;
    map.rejectUnknown();
  }
  config.realtime =
      policy == "enforce" ? machine::RealtimePolicy::kEnforce : machine::RealtimePolicy::kWarn;
}

}  // namespace

NodeConfig readNodeConfig(const ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues) {
  NodeConfig config;
  ConfigReader reader(tree, name, issues);
  config.backend = readGpio(reader.map("gpio"));
  config.joint_state_rate =
      reader.number("joint_state_rate", kJointStateRates, config.joint_state_rate);
  readRealtime(reader, valueOf(tree, "realtime"), config);

  const std::size_t issues_before = issues.size();
  reader.allow("axes");
  config.axes = axis::readAxes(valueOf(tree, "axes"), reader.fullName("axes"), issues);
  const bool axes_are_right = issues.size() == issues_before;
  config.simulation = readSimulation(reader.map("simulation"), config.axes, axes_are_right);
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
