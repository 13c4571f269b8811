#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/machine/machine.h"

/// What Python asks for, as the core takes it. They need the GIL.
namespace stepdriver::python {

/// @param values any iterable of numbers, such as an array of numpy.
/// @throw py::error_already_set with a TypeError if it isn't one.
std::vector<double> numbersOf(const pybind11::handle& values);

/// A configuration of dicts, lists, numbers, texts and None.
///
/// @throw py::type_error for anything else; it names the key.
config::ConfigValue configOf(const pybind11::handle& value, const std::string& name = "");

/// @param item a PathSegment of paths.py, or a sequence of numbers: a line to there.
/// @param names of the axes of the path: the first two are the plane of an arc that names no plane.
motion::PathSegment segmentOf(const pybind11::handle& item, const std::vector<std::string>& names);
std::vector<motion::PathSegment> segmentsOf(const pybind11::iterable& items,
                                            const std::vector<std::string>& names);

/// @param times [s]
/// @param positions, velocities, accelerations a row of numbers for each time; the last two may be
/// None.
std::vector<motion::TrajectoryPoint> pointsOf(const pybind11::handle& times,
                                              const pybind11::handle& positions,
                                              const pybind11::handle& velocities,
                                              const pybind11::handle& accelerations);

/// @param values [unit or unit/s] by the name of the axis.
/// @param since AxisState::stops by the name of the axis, for those that are checked.
std::vector<machine::StreamMessage> messagesOf(const pybind11::dict& values,
                                               const pybind11::dict& since);

}  // namespace stepdriver::python
