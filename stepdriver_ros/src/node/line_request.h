#pragma once

#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// @tparam Fields those of a request of the service move_line, or of a goal of the action.
template <typename Fields>
motion::LineRequest lineRequest(const Fields& fields) {
  motion::LineRequest line;
  line.names = fields.name;
  line.positions = fields.position;
  line.relative = fields.relative != 0;
  line.velocity = fields.velocity;
  line.duration = fields.duration;
  return line;
}

}  // namespace stepdriver::ros_node
