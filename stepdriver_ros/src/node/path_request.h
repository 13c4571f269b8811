#pragma once

#include <stepdriver/OutputLead.h>
#include <stepdriver/PathSegment.h>

#include <vector>

#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// @throw Refused if there are too many segments, if one has no known shape, or an arc no plane or
///   point.
std::vector<motion::PathSegment> pathSegments(const std::vector<PathSegment>& fields);

std::vector<motion::OutputLead> outputLeads(const std::vector<OutputLead>& fields);

/// A path to which nothing is appended.
///
/// @tparam Fields those of a request of the service plan_path, or of pathRequest().
/// @throw Refused as pathSegments().
template <typename Fields>
motion::PathRequest wholePath(const Fields& fields) {
  motion::PathRequest path;
  path.names = fields.name;
  path.segments = pathSegments(fields.segments);
  path.relative = fields.relative != 0;
  path.velocity = fields.velocity;
  path.tolerance = fields.tolerance;
  path.leads = outputLeads(fields.leads);
  return path;
}

/// @tparam Fields those of a request of the service follow_path, or of a goal of the action.
/// @throw Refused as pathSegments().
template <typename Fields>
motion::PathRequest pathRequest(const Fields& fields) {
  motion::PathRequest path = wholePath(fields);
  path.more_follows = fields.more_follows != 0;
  return path;
}

}  // namespace stepdriver::ros_node
