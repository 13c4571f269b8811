#include "path_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "message_text.h"
#include "path_plan.h"
#include "printable.h"
#include "profile/errors.h"
#include "stepdriver_core/error.h"

namespace stepdriver::motion {

using Shape = PathSegment::Shape;

namespace {

// [microsteps] A segment on which every axis moves less is left out. Ways that are left out add up,
// because the next segment begins at the end of the last one that counts.
constexpr double kShortestSegment = 1e-3;
// [microsteps] The ends of an arc are the same if they differ by less than this in each axis of its
// plane, because senders calculate them. A path may also begin that far from its place, see
// planPath().
constexpr double kSameEnds = 2e-3;
constexpr double kFullTurn = 2.0 * 3.14159265358979323846;  // [rad]

}  // namespace

std::string segmentText(std::size_t index) { return fmt::format("segment {} of the path", index); }

void PathReader::read(const PathSegment& given, std::vector<CurveSegment>& segments) {
  CurveSegment segment = segmentOf(given);
  const bool leads_nowhere = leadsNowhere(given, segment);
  if (!given.outputs.empty()) readOutputs(given, segment, leads_nowhere, segments.size());
  ++index_;
  if (!leads_nowhere) {
    before_ = segment.end;
    segments.push_back(std::move(segment));
  } else if (!segments.empty()) {
    segments.back().tolerance = std::min(segments.back().tolerance, segment.tolerance);
  }
}

CurveSegment PathReader::segmentOf(const PathSegment& given) const {
  CurveSegment segment;
  segment.number = index_;
  segment.end = positions(given.end, "positions");
  switch (given.shape) {
    case Shape::kLine:
      break;
    case Shape::kArcAround:
    case Shape::kArcThrough:
      readArc(given, segment);
      break;
    case Shape::kBezier:
      segment.shape = CurveSegment::Shape::kBezier;
      segment.control1 = positions(given.control1, "numbers in control1");
      segment.control2 = positions(given.control2, "numbers in control2");
      break;
  }
  readSpeed(given, segment);
  segment.tolerance = given.tolerance.value_or(frame_.tolerance);
  requirePositive("tolerance", segment.tolerance);
  return segment;
}

void PathReader::readOutputs(const PathSegment& given, const CurveSegment& segment,
                             bool leads_nowhere, std::size_t number) {
  const std::vector<PathOutput>& outputs = *frame_.outputs;
  const auto first = static_cast<std::ptrdiff_t>(marks_.size());
  std::optional<Path> alone;
  std::optional<ArcLength> way;
  const bool has_distances =
      std::any_of(given.outputs.begin(), given.outputs.end(),
                  [](const OutputSwitch& wanted) { return wanted.distance != 0.0; });
  if (has_distances && !leads_nowhere) {
    try {
      alone.emplace(before_, std::vector<CurveSegment>{segment}, resolutionOf(axes_));
    } catch (const Malformed& error) {
      throw Refused(error.what());
    }
    way.emplace(*alone, 0, segment.measured);
  }
  for (const OutputSwitch& wanted : given.outputs) {
    const auto found = std::find_if(outputs.begin(), outputs.end(), [&](const PathOutput& output) {
      return output.name == wanted.output;
    });
    if (found == outputs.end()) {
      refuse(fmt::format("switches the output {}, but {}", printable(wanted.output),
                         outputsText(outputs)));
    }
    PathMark mark;
    mark.segment = number;
    mark.parameter = parameterOf(wanted, way ? &*way : nullptr);
    mark.output = static_cast<std::size_t>(found - outputs.begin());
    mark.setting = settingOf(wanted, found->is_pwm);
    mark.number = index_;
    marks_.push_back(mark);
  }
  const auto place_of = [](const PathMark& mark) { return std::pair(mark.parameter, mark.output); };
  std::sort(marks_.begin() + first, marks_.end(), [&](const PathMark& one, const PathMark& other) {
    return place_of(one) < place_of(other);
  });
  const auto twice = std::adjacent_find(
      marks_.begin() + first, marks_.end(),
      [&](const PathMark& one, const PathMark& other) { return place_of(one) == place_of(other); });
  if (twice != marks_.end()) {
    refuse(fmt::format("switches the output {} twice", outputs[twice->output].name));
  }
}

double PathReader::parameterOf(const OutputSwitch& wanted, const ArcLength* way) const {
  if (wanted.distance == 0.0) return 0.0;
  const double length = way != nullptr ? way->length() : 0.0;
  const auto parameter =
      way != nullptr && wanted.distance > 0.0 ? way->parameterAt(wanted.distance) : std::nullopt;
  if (parameter) return *parameter;
  refuse(fmt::format("switches the output {} at {} m or rad, but must do so at 0 to {}, its length",
                     wanted.output, numberText(wanted.distance), upperBoundText(length)));
}

OutputSetting PathReader::settingOf(const OutputSwitch& wanted, bool is_pwm) const {
  const std::string why = whyNoValue(wanted.on, wanted.value, is_pwm);
  if (!why.empty()) refuse(fmt::format("switches the output {}: {}", wanted.output, why));
  return OutputSetting::of(wanted.on, wanted.value);
}

void PathReader::refuse(const std::string& why) const {
  throw Refused(segmentText(index_) + " " + why);
}

std::vector<double> PathReader::positions(const std::vector<double>& given,
                                          const char* what) const {
  if (given.size() != axes_.size()) {
    refuse(fmt::format("has {} {}, but must have {}", given.size(), what, axes_.size()));
  }
  std::vector<double> positions;
  positions.reserve(given.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    positions.push_back(place(i, given[i], what));
  }
  return positions;
}

double PathReader::place(std::size_t axis, double given, const char* what) const {
  if (std::isfinite(given)) return frame_.zero[axis] + given;
  axes_[axis].refuse(fmt::format("{} has {} among its {}, but they must be finite",
                                 segmentText(index_), numberText(given), what));
}

void PathReader::requirePositive(const char* what, double value) const {
  if (std::isfinite(value) && value >= 0.0) return;
  refuse(fmt::format("has the {} {}, but it must be a finite number from 0 on", what,
                     numberText(value)));
}

void PathReader::readArc(const PathSegment& given, CurveSegment& segment) const {
  segment.shape = CurveSegment::Shape::kArc;
  std::array<double, 2> from{};
  std::array<double, 2> point{};
  std::array<double, 2> to{};
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t axis = axisOf(given.plane[k]);
    segment.plane[k] = axis;
    from[k] = before_[axis];
    to[k] = segment.end[axis];
    point[k] = place(axis, given.point[k], "numbers in point");
  }
  if (areSame(segment.plane, from, to)) {
    to = from;
    for (std::size_t k = 0; k < 2; ++k) segment.end[segment.plane[k]] = from[k];
  }
  const auto [a, b] = segment.plane;
  if (a == b || axes_[a].kind != axes_[b].kind) {
    refuse(
        fmt::format("is an arc in the plane of {} and {}, but must have two different axes "
                    "of the same kind",
                    given.plane[0], given.plane[1]));
  }
  const bool around = given.shape == Shape::kArcAround;
  if (around) requireCircle(axes_[a], from, point, to);
  Arc arc = around ? arcAround(from, point, to, given.clockwise) : arcThrough(from, point, to);
  const double turned = std::abs(arc.angle) * std::hypot(from[0] - point[0], from[1] - point[1]);
  // Its ends are in the same direction, but not equally far from the centre.
  if (around && turned * axes_[a].steps_per_unit < kSameEnds) {
    arc.angle += std::copysign(kFullTurn, arc.angle);
  }
  if (arc.angle == 0.0) {
    refuse("is an arc through three points that are in line, or of which two are the same");
  }
  segment.centre = arc.centre;
  segment.angle = arc.angle;
}

std::size_t PathReader::axisOf(const std::string& name) const {
  const auto found = std::find(frame_.names.begin(), frame_.names.end(), name);
  if (found != frame_.names.end()) {
    return static_cast<std::size_t>(found - frame_.names.begin());
  }
  refuse(fmt::format("is an arc in a plane of '{}', which isn't among the path's axes, {}", name,
                     listText(frame_.names, "and")));
}

void PathReader::requireCircle(const PathAxis& axis, const std::array<double, 2>& from,
                               const std::array<double, 2>& centre,
                               const std::array<double, 2>& to) const {
  const double begin = std::hypot(from[0] - centre[0], from[1] - centre[1]);
  const double end = std::hypot(to[0] - centre[0], to[1] - centre[1]);
  if (begin * axis.steps_per_unit < 1.0 || end * axis.steps_per_unit < 1.0) {
    refuse(fmt::format("is an arc with a radius of {}, but it must be a microstep or more",
                       axis.show(std::min(begin, end))));
  }
  const double most =
      std::max(kArcMismatch, std::min(kArcMismatchShare * begin, kLargestArcMismatch));
  if (std::abs(begin - end) <= most) return;
  refuse(fmt::format(
      "is an arc that begins {} from its centre and ends {} from it; these may differ by {}",
      axis.show(begin), axis.show(end), axis.show(most)));
}

bool PathReader::areSame(const std::array<std::size_t, 2>& plane, const std::array<double, 2>& from,
                         const std::array<double, 2>& to) const {
  for (std::size_t k = 0; k < 2; ++k) {
    if (std::abs(to[k] - from[k]) * axes_[plane[k]].steps_per_unit > kSameEnds) return false;
  }
  return true;
}

bool PathReader::leadsNowhere(const PathSegment& given, const CurveSegment& segment) const {
  if (segment.shape == CurveSegment::Shape::kArc) return false;
  double longest = 0.0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto include = [&](double position) {
      const double way = std::abs(position - before_[i]) * axes_[i].steps_per_unit;
      longest = std::max(longest, way);
    };
    include(segment.end[i]);
    if (given.shape != Shape::kBezier) continue;
    include(segment.control1[i]);
    include(segment.control2[i]);
  }
  return longest < kShortestSegment;
}

void PathReader::readSpeed(const PathSegment& given, CurveSegment& segment) const {
  requirePositive("velocity", given.velocity);
  const double velocity = given.velocity > 0.0 ? given.velocity : frame_.velocity;
  if (velocity == 0.0) return;
  segment.speed = velocity;
  bool linear_moves = false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    linear_moves = linear_moves || (isLinear(i) && moves(segment, i));
  }
  double finest = 0.0;  // [microsteps/unit]
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    segment.measured.push_back(isLinear(i) == linear_moves);
    if (segment.measured.back()) finest = std::max(finest, axes_[i].steps_per_unit);
  }
  requireRate(velocity, finest, linear_moves ? "m/s" : "rad/s");
}

void PathReader::requireRate(double velocity, double finest, const char* unit) const {
  if (velocity * finest * (1.0 + 1e-9) >= config::kLowestRate) return;
  refuse(
      fmt::format("has the velocity {} {}, but it must be 0, or at least {} {}, which is {} "
                  "steps/s of the axis with the most steps",
                  numberText(velocity), unit, lowerBoundText(config::kLowestRate / finest), unit,
                  numberText(config::kLowestRate)));
}

bool PathReader::moves(const CurveSegment& segment, std::size_t axis) const {
  if (segment.end[axis] != before_[axis]) return true;
  switch (segment.shape) {
    case CurveSegment::Shape::kLine:
      return false;
    case CurveSegment::Shape::kArc:
      return segment.plane[0] == axis || segment.plane[1] == axis;
    case CurveSegment::Shape::kBezier:
      return segment.control1[axis] != before_[axis] || segment.control2[axis] != before_[axis];
  }
  return false;
}

}  // namespace stepdriver::motion
