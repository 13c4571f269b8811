#include "requests.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::python {
namespace {

namespace py = pybind11;
using Shape = motion::PathSegment::Shape;

// An int that the core doesn't count with is a number like any other: its reader says what is
// allowed.
config::ConfigValue numberOf(const py::handle& value) {
  int overflow = 0;
  const long long number = PyLong_AsLongLongAndOverflow(value.ptr(), &overflow);
  using Limits = std::numeric_limits<int>;
  if (overflow == 0 && number >= Limits::min() && number <= Limits::max()) {
    return {static_cast<int>(number)};
  }
  return {value.cast<double>()};
}

config::ConfigValue mapOf(const py::dict& items, const std::string& name) {
  config::ConfigValue::Map map;
  for (const auto& [key, value] : items) {
    if (!py::isinstance<py::str>(key)) {
      auto message = py::str("{!r} is a key in '{}', but keys must be strings").format(key, name);
      throw py::type_error(message.cast<std::string>());
    }
    const auto text = key.cast<std::string>();
    std::string full_name = name.empty() ? text : name;
    if (!name.empty()) full_name.append("/").append(text);
    map[text] = configOf(value, full_name);
  }
  return {std::move(map)};
}

config::ConfigValue listOf(const py::sequence& items, const std::string& name) {
  config::ConfigValue::List list;
  for (const py::handle item : items) list.push_back(configOf(item, name));
  return {std::move(list)};
}

// Whatever Python takes for a real number, such as one of numpy, but no text.
double numberIn(const py::handle& value) {
  const double number = PyFloat_AsDouble(value.ptr());
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return number;
}

std::array<double, 2> pointOf(const py::handle& values) {
  const std::vector<double> numbers = numbersOf(values);
  if (numbers.size() != 2) {
    throw Refused("the point of an arc has " + std::to_string(numbers.size()) +
                  " numbers, but must have 2");
  }
  return {numbers[0], numbers[1]};
}

std::array<std::string, 2> planeOf(const py::handle& plane, const std::vector<std::string>& names) {
  std::vector<std::string> axes;
  if (plane.is_none()) {
    axes.assign(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(
                                                   std::min<std::size_t>(2, names.size())));
  } else {
    for (const py::handle axis : py::iter(plane)) axes.push_back(py::str(axis));
  }
  if (axes.size() != 2) {
    throw Refused("the plane of an arc has " + std::to_string(axes.size()) +
                  " axes, but must have 2");
  }
  return {axes[0], axes[1]};
}

Shape shapeOf(const std::string& name) {
  static const std::map<std::string, Shape> shapes{{"line", Shape::kLine},
                                                   {"arc_around", Shape::kArcAround},
                                                   {"arc_through", Shape::kArcThrough},
                                                   {"bezier", Shape::kBezier}};
  const auto found = shapes.find(name);
  if (found == shapes.end()) {
    throw Refused("the shape of a segment is '" + name +
                  "', but must be line, arc_around, arc_through or bezier");
  }
  return found->second;
}

void readArc(const py::handle& item, const std::vector<std::string>& names,
             motion::PathSegment& segment) {
  segment.plane = planeOf(item.attr("plane"), names);
  segment.point = pointOf(item.attr("point"));
  segment.clockwise = item.attr("clockwise").cast<bool>();
}

using Rows = std::vector<std::vector<double>>;

Rows rowsOf(const char* what, const py::handle& values, std::size_t times) {
  Rows rows;
  for (const py::handle row : py::iter(values)) rows.push_back(numbersOf(row));
  if (rows.size() == times) return rows;
  throw Refused("the trajectory has " + std::to_string(times) + " times, but " +
                std::to_string(rows.size()) + " rows of " + what);
}

}  // namespace

std::vector<double> numbersOf(const py::handle& values) {
  std::vector<double> numbers;
  for (const py::handle value : py::iter(values)) numbers.push_back(numberIn(value));
  return numbers;
}

config::ConfigValue configOf(const py::handle& value, const std::string& name) {
  if (value.is_none()) return {};
  if (py::isinstance<py::bool_>(value)) return {value.cast<bool>()};
  if (py::isinstance<py::int_>(value)) return numberOf(value);
  if (py::isinstance<py::float_>(value)) return {value.cast<double>()};
  if (py::isinstance<py::str>(value)) return {value.cast<std::string>()};
  if (py::isinstance<py::dict>(value)) return mapOf(value.cast<py::dict>(), name);
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    return listOf(value.cast<py::sequence>(), name);
  }
  throw py::type_error("'" + name + "' is a " +
                       std::string(py::str(py::type::of(value).attr("__name__"))) +
                       ", but must be a dict, a list, a number, a string, a bool or None");
}

motion::PathSegment segmentOf(const py::handle& item, const std::vector<std::string>& names) {
  motion::PathSegment segment;
  if (!py::hasattr(item, "shape") || !py::isinstance<py::str>(item.attr("shape"))) {
    segment.end = numbersOf(item);  // an array of numpy has a shape too
    return segment;
  }
  segment.shape = shapeOf(item.attr("shape").cast<std::string>());
  segment.end = numbersOf(item.attr("end"));
  if (segment.shape == Shape::kArcAround || segment.shape == Shape::kArcThrough) {
    readArc(item, names, segment);
  }
  if (segment.shape == Shape::kBezier) {
    segment.control1 = numbersOf(item.attr("control1"));
    segment.control2 = numbersOf(item.attr("control2"));
  }
  segment.velocity = item.attr("velocity").cast<double>();
  segment.tolerance = item.attr("tolerance").cast<std::optional<double>>();
  const auto add_output = [&](const std::string& name, double value, double distance) {
    segment.outputs.push_back({name, value != 0.0, value != 0.0 ? value : 1.0, distance});
  };
  const py::object outputs = item.attr("outputs");
  if (py::isinstance<py::dict>(outputs)) {
    for (const auto& [name, value] : outputs.cast<std::map<std::string, double>>()) {
      add_output(name, value, 0.0);
    }
  } else {
    using Place = std::tuple<std::string, double, double>;
    for (const auto& [name, value, distance] : outputs.cast<std::vector<Place>>()) {
      add_output(name, value, distance);
    }
  }
  return segment;
}

std::vector<motion::PathSegment> segmentsOf(const py::iterable& items,
                                            const std::vector<std::string>& names) {
  std::vector<motion::PathSegment> segments;
  for (const py::handle item : items) segments.push_back(segmentOf(item, names));
  return segments;
}

std::vector<motion::TrajectoryPoint> pointsOf(const py::handle& times, const py::handle& positions,
                                              const py::handle& velocities,
                                              const py::handle& accelerations) {
  const std::vector<double> at = numbersOf(times);
  const Rows places = rowsOf("positions", positions, at.size());
  const Rows speeds = velocities.is_none() ? Rows() : rowsOf("velocities", velocities, at.size());
  const Rows changes =
      accelerations.is_none() ? Rows() : rowsOf("accelerations", accelerations, at.size());
  std::vector<motion::TrajectoryPoint> points(at.size());
  for (std::size_t i = 0; i < at.size(); ++i) {
    points[i].time = at[i];
    points[i].positions = places[i];
    if (!speeds.empty()) points[i].velocities = speeds[i];
    if (!changes.empty()) points[i].accelerations = changes[i];
  }
  return points;
}

std::vector<machine::StreamMessage> messagesOf(const py::dict& values, const py::dict& since) {
  std::vector<machine::StreamMessage> messages;
  for (const auto& [name, value] : values) {
    machine::StreamMessage message{py::str(name), numberIn(value), {}};
    if (since.contains(name)) message.unless_stopped_since = since[name].cast<std::uint64_t>();
    messages.push_back(std::move(message));
  }
  return messages;
}

}  // namespace stepdriver::python
