#pragma once

#include <cstddef>
#include <vector>

#include "bus/register_job.h"
#include "request_context.h"

/// Requests that change a register of an axis's driver chips.
namespace stepdriver::machine {

/// The motors of the axis whose chips have registers.
/// @throw Refused while one of them can't be changed.
std::vector<std::size_t> settableChips(axis::AxisModel& axis);

/// The caller has its answer when the chip has taken it.
void writeSetting(RequestContext& machine, AxisId axis, std::size_t motor, bus::RegisterJob job,
                  const SharedCall& call);

}  // namespace stepdriver::machine
