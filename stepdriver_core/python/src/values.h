#pragma once

#include <pybind11/pybind11.h>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/io.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/sim/rig.h"

/// The core's values for Python: each as a dict whose keys are the fields of the Python class that
/// is made from it. They need the GIL.
namespace stepdriver::python {

pybind11::dict valueOf(const axis::AxisState& state);
pybind11::dict valueOf(const axis::AxisLimits& limits);
pybind11::dict valueOf(const axis::EndstopState& endstops);
pybind11::dict valueOf(const axis::MoveResult& result);
pybind11::dict valueOf(const axis::HomingResult& result);
pybind11::dict valueOf(const axis::MovePlan& plan);
pybind11::dict valueOf(const machine::CoordinatedResult& result);
pybind11::dict valueOf(const motion::PathAhead& ahead);
pybind11::dict valueOf(const machine::EngineFigures& figures);
pybind11::dict valueOf(const machine::OutputState& output);
pybind11::dict valueOf(const machine::InputState& input);
pybind11::dict valueOf(const machine::LatchedEdge& edge);
pybind11::dict valueOf(const machine::LatchResult& result);
pybind11::dict valueOf(const machine::ProbeResult& result);
pybind11::dict valueOf(const sim::RigAxisReport& report);

/// None if there is none.
template <typename Value>
pybind11::object valueOf(const std::optional<Value>& value) {
  if (!value) return pybind11::none();
  return valueOf(*value);
}

}  // namespace stepdriver::python
