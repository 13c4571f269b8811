#pragma once

namespace stepdriver::ros_node {

/// @return whether ROS_IP or ROS_HOSTNAME tells roscpp to let only this computer in.
bool onlyThisComputerMayCall();

/// Call it after the first ros::NodeHandle. roscpp's ports for topics and services are on the
/// loopback if onlyThisComputerMayCall(), but its XML-RPC server is on every address, so that
/// another computer could end the node. This closes that server to others too, and warns if it
/// can't (before Linux 5.7). It also warns if the address that the node tells others isn't one on
/// which it listens.
void closeToOtherComputers();

}  // namespace stepdriver::ros_node
