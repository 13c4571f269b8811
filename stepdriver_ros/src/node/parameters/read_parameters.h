#pragma once

#include <string>
#include <vector>

#include "common/node_config.h"

namespace stepdriver::ros_node {

struct Parameters {
  NodeConfig config;
  /// [Hz] of the actions; 0: never. The default is that of actionlib.
  double action_status_frequency = 5.0;
  /// Sentences for the log: the limits of the axes and where they come from.
  std::vector<std::string> notes;
  std::vector<std::string> warnings;
};

/// Reads and checks all parameters of the node: its own, the robot description, whose limits it
/// applies, and actionlib_status_frequency, which all action servers of a namespace share. It needs
/// a master and ros::init(), but not ros::start(): with that the master shuts down a running node
/// of the same name, which a mistake in the parameters must not do.
///
/// @throw ConfigError listing every mistake.
Parameters readParameters();

}  // namespace stepdriver::ros_node
