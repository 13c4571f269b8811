#include "wizard.h"

#include <fmt/format.h>
#include <ros/init.h>
#include <ros/names.h>

#include <vector>

#include "../driver_parameters.h"
#include "axis_bring_up.h"
#include "common/node_config.h"
#include "common/node_start.h"
#include "configuration_file.h"
#include "driver_at_hand.h"
#include "line_dialogue.h"

namespace stepdriver::console {
namespace {

std::vector<config::AxisConfig> chosenAxes(const DriverParameters& parameters,
                                           const std::string& only) {
  std::vector<config::AxisConfig> axes;
  std::string names;
  for (const config::AxisConfig& axis : parameters.axes) {
    names += (names.empty() ? "" : ", ") + axis.name;
    if (only.empty() || axis.name == only) axes.push_back(axis);
  }
  if (axes.empty()) {
    throw Error(fmt::format("--axis {}: there is no such axis, but {}", only, names));
  }
  return axes;
}

/// The driver must accept the written parameters.
///
/// @throw ConfigError
void check(const config::ConfigValue& parameters, const std::string& driver) {
  std::vector<ConfigIssue> issues;
  ros_node::readNodeConfig(parameters, driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
}

std::vector<std::string> commentOf(const std::string& driver,
                                   const std::vector<std::string>& changes) {
  std::vector<std::string> comment = {
      fmt::format("The parameters of {}, by `rosrun stepdriver console --wizard`.", driver)};
  if (changes.empty()) comment.emplace_back("Nothing had to be changed.");
  for (const std::string& change : changes) comment.push_back(change + ".");
  return comment;
}

/// @return what must be changed, in words.
std::vector<std::string> bringUpAll(Dialogue& dialogue, MachineAtHand& machine,
                                    const std::vector<config::AxisConfig>& axes,
                                    config::ConfigValue& parameters) {
  std::vector<std::string> changes;
  for (const config::AxisConfig& axis : axes) {
    if (axes.size() > 1 && !askYesNo(dialogue, "Look at axis " + axis.name + "?", true)) continue;
    const Findings findings = bringUp(dialogue, machine, axis);
    parameters = corrected(std::move(parameters), findings);
    for (const std::string& change : changesText(findings, axis)) changes.push_back(change);
  }
  return changes;
}

}  // namespace

bool runWizard(const ros::NodeHandle& node, const std::string& driver, const WizardOptions& options,
               ros_node::EndRequests& end_requests) {
  checkNewFile(options.output, options.overwrite);
  const DriverParameters known = readDriverParameters(driver);
  const std::vector<config::AxisConfig> axes = chosenAxes(known, options.axis);
  config::ConfigValue parameters = ros_node::privateParameters(ros::names::resolve(driver));
  DriverAtHand machine(node, driver, known);
  LineDialogue dialogue(end_requests, [&machine] { machine.poll(); });
  try {
    machine.awaitState();
    dialogue.say("First bring-up of " + driver +
                 ".\nNothing moves before you say so, and then a little and slowly.\n"
                 "Have a hand on the power switch. Enter stops a move; q at any question, or "
                 "Ctrl-C at any time,\nends all of it, and nothing is written.");
    const std::vector<std::string> changes = bringUpAll(dialogue, machine, axes, parameters);
    dialogue.say("\n==== Result");
    if (changes.empty()) dialogue.say("Nothing has to be changed.");
    for (const std::string& change : changes) dialogue.say("  " + change);
    check(parameters, driver);
    if (!askYesNo(dialogue, "Write it to " + options.output + "?", true)) return false;
    writeFile(options.output, configurationText(parameters, commentOf(driver, changes)),
              options.overwrite);
    dialogue.say(
        "Written. The driver that runs hasn't changed: start it anew with\n"
        "  roslaunch stepdriver axis.launch config:=$(realpath " +
        options.output + ")\nand what else you start it with; then look at it once more.");
    return true;
  } catch (const Ended& ended) {
    dialogue.say(std::string("\nNothing is written: ") + ended.what() + ".");
    return false;
  }
}

}  // namespace stepdriver::console
