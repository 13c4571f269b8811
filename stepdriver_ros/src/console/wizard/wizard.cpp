#include "wizard.h"

#include <fmt/format.h>
#include <ros/init.h>
#include <ros/names.h>

#include <optional>
#include <utility>
#include <vector>

#include "../driver_parameters.h"
#include "axis_bring_up.h"
#include "common/node_config.h"
#include "common/node_start.h"
#include "configuration_file.h"
#include "corrected_text.h"
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
    throw Error(fmt::format("--axis {}: there is no such axis; the driver has {}", only, names));
  }
  return axes;
}

std::vector<std::string> namesOf(const std::vector<config::AxisConfig>& axes) {
  std::vector<std::string> names;
  names.reserve(axes.size());
  for (const config::AxisConfig& axis : axes) names.push_back(axis.name);
  return names;
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

/// What all bring-ups have found.
struct Result {
  std::vector<Findings> findings;
  std::vector<std::string> changes;  ///< in words
};

Result bringUpAll(Dialogue& dialogue, MachineAtHand& machine,
                  const std::vector<config::AxisConfig>& axes) {
  Result result;
  for (const config::AxisConfig& axis : axes) {
    if (axis.motors() > 1) {
      dialogue.say("Axis " + axis.name +
                   " has several motors, and the wizard checks only axes with one. Try it by hand: "
                   "a short move turns all its motors in the same direction of the axis.");
      continue;
    }
    if (axes.size() > 1 && !askYesNo(dialogue, "Check axis " + axis.name + "?", true)) continue;
    const Findings findings = bringUp(dialogue, machine, axis);
    result.findings.push_back(findings);
    for (const std::string& change : changesText(findings, axis)) result.changes.push_back(change);
  }
  return result;
}

/// The text for the output file, after a question.
///
/// @param own the text of the driver's file; empty: not known.
/// @param parameters of the node, corrected.
/// @return empty: nothing shall be written.
std::optional<std::string> askForText(Dialogue& dialogue, const std::string& driver,
                                      const WizardOptions& options, const std::string& own,
                                      const config::ConfigValue& parameters, const Result& result) {
  const std::string all = configurationText(parameters, commentOf(driver, result.changes));
  if (own.empty()) {
    const bool yes = askYesNo(dialogue, "Write all parameters to " + options.output + "?", true);
    return yes ? std::optional(all) : std::nullopt;
  }
  const CorrectedText corrected = correctedText(own, result.findings);
  if (corrected.by_hand.empty()) {
    const std::string question = fmt::format(
        "Write {}, with these changes and its comments, to {}?", options.config, options.output);
    return askYesNo(dialogue, question, true) ? std::optional(corrected.text) : std::nullopt;
  }
  dialogue.say(fmt::format(
      "The wizard can't make these changes in the text of {}. Make them by hand:", options.config));
  for (const std::string& change : corrected.by_hand) dialogue.say("  " + change);
  const std::string question =
      fmt::format("Write all parameters to {} instead, without the comments of {}?", options.output,
                  options.config);
  return askYesNo(dialogue, question, false) ? std::optional(all) : std::nullopt;
}

}  // namespace

bool runWizard(const ros::NodeHandle& node, const std::string& driver, const WizardOptions& options,
               ros_node::EndRequests& end_requests) {
  checkNewFile(options.output, options.overwrite);
  const DriverParameters known = readDriverParameters(driver);
  const std::vector<config::AxisConfig> axes = chosenAxes(known, options.axis);
  config::ConfigValue parameters = ros_node::privateParameters(ros::names::resolve(driver));
  const std::string own = options.config.empty()
                              ? std::string()
                              : readOwnFile(options.config, parameters, namesOf(axes));
  DriverAtHand machine(node, driver, known);
  LineDialogue dialogue(end_requests, [&machine] { machine.poll(); });
  try {
    machine.awaitState();
    dialogue.say(
        "First bring-up of " + driver +
        ".\nEach move comes after a question, is short, and is slow.\n"
        "Keep a hand on the power switch. Enter stops a move. To quit, press q at a question, "
        "or Ctrl-C at any time; nothing is written then.");
    if (own.empty()) {
      dialogue.say("To keep the comments of your configuration file, name it by --config FILE.");
    }
    const Result result = bringUpAll(dialogue, machine, axes);
    for (const Findings& findings : result.findings) {
      parameters = corrected(std::move(parameters), findings);
    }
    dialogue.say("\n==== Result");
    if (result.changes.empty()) dialogue.say("Nothing needs to be changed.");
    for (const std::string& change : result.changes) dialogue.say("  " + change);
    check(parameters, driver);
    const auto text = askForText(dialogue, driver, options, own, parameters, result);
    if (!text) return false;
    writeFile(options.output, *text, options.overwrite);
    dialogue.say(
        "Written. The running driver isn't changed. Restart it with\n"
        "  roslaunch stepdriver axis.launch config:=$(realpath " +
        options.output + ")\nand your other arguments, then run the wizard again to check it.");
    return true;
  } catch (const Ended& ended) {
    dialogue.say(std::string("\nNothing is written: ") + ended.what() + ".");
    return false;
  }
}

}  // namespace stepdriver::console
