#pragma once

#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/this_node.h>

#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "end_requests.h"
#include "loopback_only.h"
#include "master_watch.h"
#include "node_start.h"
#include "stepdriver_core/error.h"

// The nodes that send their commands to a stepdriver_node, the driver: the joystick and the base.

namespace stepdriver::ros_node {

/// Adds an issue if the parameter ~driver can't be the name of a node.
///
/// @param node_name full name of this node.
void checkDriverName(const std::string& driver, const std::string& node_name,
                     std::vector<ConfigIssue>& issues);

/// Serves this node's callbacks until it is asked to end, and logs by whom.
void serveUntilEnd(EndRequests& end_requests);

/// Ends roscpp and the calls without an answer, once the last messages are out.
void shutdownAfterLastMessages();

/// Runs such a node to its end.
///
/// @param read_parameters a function without arguments.
/// @param make a function of the node handle and the result of read_parameters(). It returns a
///   pointer to an object with a function lookAgain(), which is called before this node registers
///   again with a restarted master, in another thread and until it returns true, and a function
///   rest(), which is called at the end.
/// @return the exit code; anything thrown is logged as the reason not to start.
template <typename ReadParameters, typename Make>
int runClientNode(EndRequests& end_requests, const ReadParameters& read_parameters,
                  const Make& make) {
  std::optional<ros::NodeHandle> node;  // roscpp and its console end with it
  try {
    // Before the handle registers this node, which ends a running node with the same name.
    const auto parameters = read_parameters();
    node.emplace();
    closeToOtherComputers();
    end_requests.takeOverShutdownCall();
    const auto client = make(*node, parameters);
    MasterWatch master(ros::this_node::getName() + "/get_loggers",
                       loggedEvents([] {}, [&client] { return client->lookAgain(); }));
    master.start();
    serveUntilEnd(end_requests);
    master.stop();
    client->rest();
    shutdownAfterLastMessages();
    return kExitOk;
  } catch (const ConfigError& error) {
    explain(error, ros::this_node::getName(), "Not started");
  } catch (const std::exception& error) {
    ROS_FATAL_NAMED("node", "Not started: %s", error.what());
  }
  return kExitConfig;
}

}  // namespace stepdriver::ros_node
