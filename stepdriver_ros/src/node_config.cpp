#include "node_config.h"

#include "stepdriver_core/axis/config_reader.h"

namespace stepdriver::ros_node {
namespace {

using axis::ConfigReader;
using axis::ConfigValue;
using axis::Range;

constexpr Range kJointStateRates{1.0, 1000.0};
constexpr Range kJogTimeouts{0.02, 60.0};
constexpr double kLongestLatenessMs = 1000.0;

void readGpio(ConfigReader gpio) {
  const std::string backend = gpio.oneOf("backend", {"simulated", "libgpiod"});
  if (backend == "libgpiod") {
    gpio.issue("backend",
               "is \"libgpiod\", which is not built into this version; it must be simulated");
  }
  gpio.rejectUnknown();
}

double readMaxLateness(ConfigReader realtime, double fallback) {
  const double milliseconds =
      realtime.number("max_lateness_ms", Range{0.0, kLongestLatenessMs, true}, fallback * 1e3);
  realtime.rejectUnknown();
  return milliseconds * 1e-3;
}

const ConfigValue& valueOf(const ConfigValue& tree, const std::string& key) {
  static const ConfigValue nothing;
  const auto* map = tree.as<ConfigValue::Map>();
  const auto found = map != nullptr ? map->find(key) : ConfigValue::Map::const_iterator{};
  return map != nullptr && found != map->end() ? found->second : nothing;
}

}  // namespace

NodeConfig readNodeConfig(const ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues) {
  NodeConfig config;
  ConfigReader reader(tree, name, issues);
  readGpio(reader.map("gpio"));
  config.joint_state_rate =
      reader.number("joint_state_rate", kJointStateRates, config.joint_state_rate);
  config.jog_timeout = reader.number("jog_timeout", kJogTimeouts, config.jog_timeout);
  config.max_lateness = readMaxLateness(reader.map("realtime"), config.max_lateness);

  const std::size_t issues_before = issues.size();
  reader.allow("axes");
  config.axes = axis::readAxes(valueOf(tree, "axes"), reader.fullName("axes"), issues);
  const bool axes_are_right = issues.size() == issues_before;
  config.simulation = readSimulation(reader.map("simulation"), config.axes, axes_are_right);
  reader.rejectUnknown();
  return config;
}

}  // namespace stepdriver::ros_node
