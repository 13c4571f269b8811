#include "latch_request.h"

#include <fmt/format.h>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

machine::LatchEdge latchEdge(int edge) {
  switch (edge) {
    case LatchGoal::ACTIVE:
      return machine::LatchEdge::kActive;
    case LatchGoal::INACTIVE:
      return machine::LatchEdge::kInactive;
    case LatchGoal::EITHER:
      return machine::LatchEdge::kEither;
    default:
      throw Refused(fmt::format("edge is {}, but must be {} (ACTIVE), {} (INACTIVE) or {} (EITHER)",
                                edge, +LatchGoal::ACTIVE, +LatchGoal::INACTIVE,
                                +LatchGoal::EITHER));
  }
}

}  // namespace

machine::LatchRequest latchRequest(const LatchGoal& goal) {
  machine::LatchRequest request;
  request.input = goal.input;
  request.edge = latchEdge(goal.edge);
  request.every = goal.every != 0;
  request.axes = goal.name;
  if (!goal.window_axis.empty()) {
    request.window = machine::LatchWindow{goal.window_axis, goal.window_from, goal.window_to};
  }
  return request;
}

}  // namespace stepdriver::ros_node
