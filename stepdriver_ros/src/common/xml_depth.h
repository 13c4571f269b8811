#pragma once

namespace stepdriver::ros_node {

/// Values of XML-RPC that are nested deeper than this are not read. The deepest ones of ROS are
/// parameters, as deep as their names.
constexpr int kMostXmlDepth = 100;

/// roscpp reads XML-RPC by recursion, as deep as a message is nested: one of a megabyte takes the
/// whole stack, and ends the process. Programs that refer to this function have a limit.
///
/// @throw std::runtime_error if this roscpp can't be given that limit.
void limitXmlDepth();

}  // namespace stepdriver::ros_node
