#pragma once

#include <ros/node_handle.h>

#include <string>

#include "common/end_requests.h"

namespace stepdriver::console {

struct WizardOptions {
  std::string axis;    ///< the only axis to check; empty: all, one after the other
  std::string config;  ///< the driver's file, whose comments are kept; empty: not known
  std::string output = "stepdriver_wizard.yaml";
  bool overwrite = false;
};

/// A guided first bring-up on standard input and output: checks switches, direction and distance of
/// each axis, and writes a corrected configuration. With the driver's own file, it writes the text
/// of that file with the values changed; otherwise it writes all parameters of the node.
///
/// @param driver full name of the node.
/// @return whether the file was written.
/// @throw Error if the driver goes away, or the file can't be written; ConfigError if its
///   parameters are wrong.
bool runWizard(const ros::NodeHandle& node, const std::string& driver, const WizardOptions& options,
               ros_node::EndRequests& end_requests);

}  // namespace stepdriver::console
