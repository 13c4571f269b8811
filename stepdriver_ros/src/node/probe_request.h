#pragma once

#include "stepdriver_core/machine/io.h"

namespace stepdriver::ros_node {

/// @tparam Fields those of a request of the service probe, or of a goal of the action.
template <typename Fields>
machine::ProbeRequest probeRequest(const Fields& fields) {
  machine::ProbeRequest request;
  request.input = fields.input;
  request.names = fields.name;
  request.positions = fields.position;
  request.relative = fields.relative != 0;
  request.away = fields.away != 0;
  request.must = fields.may_miss == 0;
  request.velocity = fields.velocity;
  request.second_velocity = fields.second_velocity;
  request.back_off = fields.back_off;
  request.returns = fields.go_back != 0;
  return request;
}

}  // namespace stepdriver::ros_node
