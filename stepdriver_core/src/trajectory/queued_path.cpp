#include "queued_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "backlash.h"
#include "count_rounding.h"
#include "nanoseconds.h"
#include "path_plan.h"
#include "path_timing/jerk_limited.h"
#include "profile/errors.h"
#include "profile/profile_parts.h"
#include "profile/profile_peaks.h"
#include "profile/resting_count.h"
#include "spline.h"
#include "stepdriver_core/error.h"

namespace stepdriver::motion {

namespace {

// A plan from a speed may exceed its share of the limits by this part, which is rounding.
constexpr double kNoExcessFromSpeed = 1e-9;
// A backlash that is slower than this part of the maximum speed is at rest. Within the first knots,
// which may be microseconds apart, a higher speed would end with a high acceleration, and a hold
// may use what the plan needs anywhere.
constexpr double kStill = 1e-6;
// [microsteps] A backlash that is this close to whole microsteps is at rest.
constexpr double kNearMicrostep = 1e-3;
// If the axes can't slow down before a corner, its rounding begins later. The part of the segment
// that is left for it is halved this often; then the corner isn't rounded.
constexpr int kCornerHalvings = 6;
// [ns] Straight lines aren't divided closer to their end.
constexpr std::int64_t kShortestPart = 100'000;
// The number of starts that are tried before the end of the path.
constexpr int kMostStarts = 8;
// The number of segments before and after a corner into which it may be rounded.
constexpr std::size_t kMostRounded = 33;

void appendPieces(std::vector<Piece>& pieces, const Profile& profile) {
  for (const Piece& piece : profile.pieces()) pieces.push_back(piece);
}

double largestJerk(const Profile& profile) {
  double jerk = 0.0;
  for (const Piece& piece : profile.pieces()) jerk = std::max(jerk, std::abs(piece.j));
  return jerk;
}

double lengthBetween(const std::vector<double>& from, const std::vector<double>& to) {
  double square = 0.0;
  for (std::size_t k = 0; k < from.size(); ++k) square += (to[k] - from[k]) * (to[k] - from[k]);
  return std::sqrt(square);
}

// The derivative at the end of a segment.
double endRate(const std::vector<double>& from, const CurveSegment& segment) {
  const Path alone(from, {segment}, 1.0);
  PathPoint end;
  alone.evaluate(0, 1.0, end);
  return lengthBetween(std::vector<double>(end.first.size(), 0.0), end.first);
}

}  // namespace

// Where the new plan begins.
struct QueuedPath::Start {
  std::int64_t time_ns = 0;
  std::size_t segment = 0;
  TimingStart begin;
  // The path continues after the axes have come to rest at its end. The way from the microsteps of
  // the axes to that end takes this long, and the path begins with the new segments.
  std::optional<double> from_rest;
  bool on_straight = false;  // the start is between two knots
};

struct QueuedPath::Continuation {
  std::vector<CurveSegment> segments;  // the segments from that of the start on
  std::vector<PathMark> marks;         // the marks after the start, with their places
  PathTiming plan;
  std::vector<PathStart> states;
};

QueuedPath::QueuedPath(const std::shared_ptr<const SharedPath>& motion,
                       std::shared_ptr<const PathWindow> window, bool more_follows)
    : motion_(std::dynamic_pointer_cast<const TrajectoryPath>(motion)),
      window_(std::move(window)),
      more_follows_(more_follows) {}

std::size_t QueuedPath::segmentAt(std::int64_t time_ns) const {
  const auto later =
      std::upper_bound(window_->knots.begin() + 1, window_->knots.end(), time_ns,
                       [](std::int64_t time, const auto& knot) { return time < knot.time_ns; });
  return later == window_->knots.end() ? window_->segments.size() : later->segment;
}

PathAhead QueuedPath::aheadOf(double position) const {
  PathAhead ahead;
  ahead.segments = window_->segments.size() - segmentAt(nanoseconds(position));
  ahead.room = kMostPathSegments - std::min(kMostPathSegments, ahead.segments);
  ahead.time = std::max(0.0, motion_->end().value() - position);
  ahead.passed = position;
  ahead.more_follows = more_follows_;
  ahead.targets = window_->end();
  return ahead;
}

std::vector<double> QueuedPath::targets() const {
  std::vector<double> targets;
  for (std::size_t k = 0; k < window_->axes.size(); ++k) {
    targets.push_back(window_->axes[k].countOf(window_->end()[k]));
  }
  return targets;
}

QueuedPath::Added QueuedPath::read(const std::vector<PathSegment>& given) const {
  const std::vector<double>& end = window_->end();
  PathReader reader(window_->frame, window_->axes, end);
  Added added;
  std::vector<CurveSegment>& segments = added.segments;
  segments.reserve(given.size());
  for (const PathSegment& segment : given) reader.read(segment, segments);
  added.marks = reader.takeMarks();
  for (PathMark& mark : added.marks) mark.segment += window_->segments.size();
  if (!segments.empty()) {
    requireRange(Path(end, segments, resolutionOf(window_->axes)), window_->axes, segments);
  }
  return added;
}

// On a straight line the speed changes evenly between two knots.
QueuedPath::Start QueuedPath::onStraight(std::size_t knot, std::int64_t time_ns) const {
  const PathWindow::Knot& before = window_->knots[knot];
  const PathWindow::Knot& after = window_->knots[knot + 1];
  const double from = before.segment == after.segment ? before.parameter : 0.0;
  const double part = static_cast<double>(time_ns - before.time_ns) /
                      static_cast<double>(after.time_ns - before.time_ns);
  const double speed = before.speed + part * (after.speed - before.speed);
  const double way = part * (before.speed + speed) / (before.speed + after.speed);
  const double parameter = from + std::min(way, 1.0) * (after.parameter - from);
  return {
      time_ns, after.segment, {parameter, speed, before.acceleration, before.average}, {}, true};
}

QueuedPath::Start QueuedPath::atKnot(const PathWindow::Knot& knot) {
  return {knot.time_ns,
          knot.segment,
          {knot.parameter, knot.speed, knot.acceleration, knot.average},
          {},
          false};
}

QueuedPath::Start QueuedPath::atRest() const {
  const std::vector<double>& end = window_->end();
  const double duration = restOf(window_->axes, end, hasJerkLimit(window_->axes)).duration;
  const auto end_ns = static_cast<std::int64_t>(std::ceil(motion_->end().value() * 1e9));
  return {end_ns, window_->segments.size(), {}, duration, false};
}

// The starts in the order in which they are tried, the earliest ones first. If a later one allows
// the same, the earlier one is left out. The last one is certainly possible.
std::vector<QueuedPath::Start> QueuedPath::startsFrom(std::int64_t from_ns) const {
  const std::vector<PathWindow::Knot>& knots = window_->knots;
  std::vector<Start> starts;
  const std::int64_t time_ns = std::max(from_ns, window_->settled_ns);
  const auto first = std::lower_bound(
      knots.begin(), knots.end(), time_ns,
      [](const PathWindow::Knot& knot, std::int64_t time) { return knot.time_ns < time; });
  if (first != knots.begin() && first != knots.end() && (first - 1)->straight &&
      first->time_ns - time_ns > kShortestPart) {
    starts.push_back(onStraight(static_cast<std::size_t>(first - knots.begin()) - 1, time_ns));
  }
  if (starts.empty() && from_ns < time_ns && hasJerkLimit(window_->axes)) {
    const auto until = std::make_reverse_iterator(first);
    auto tried = knots.rend();
    for (const bool accelerates : {true, false}) {
      const auto settled = std::find_if(until, knots.rend(), [&](const PathWindow::Knot& knot) {
        return knot.may_begin || (accelerates && knot.acceleration > 0.0) || knot.time_ns < from_ns;
      });
      if (settled == knots.rend() || settled->time_ns < from_ns || settled == tried) break;
      starts.push_back(atKnot(*settled));
      tried = settled;
    }
  }
  std::ptrdiff_t step = 1;
  for (auto knot = first; knot != knots.end() && starts.size() < kMostStarts;) {
    if (!knot->may_begin) {
      ++knot;
      continue;
    }
    starts.push_back(atKnot(*knot));
    knot += std::min(step, knots.end() - knot);
    step *= 2;
  }
  const PathWindow::Knot& end = knots.back();
  if (time_ns <= end.time_ns && !window_->segments.empty()) {
    starts.push_back(atKnot(end));
  }
  starts.push_back(atRest());
  return starts;
}

// The state of the motion at a start; empty if a backlash is being taken up there.
std::optional<std::vector<PathStart>> QueuedPath::statesAt(const Start& start,
                                                           const JointPlace& joint) const {
  const std::int64_t at_ns = start.time_ns - splitNanoseconds(motion_->origin()).whole;
  std::vector<PathStart> states;
  for (std::size_t k = 0; k < window_->axes.size(); ++k) {
    const PathAxis& axis = window_->axes[k];
    PathStart& state = states.emplace_back();
    state.motor = motion_->members()[k].curve->stateAt(at_ns);
    if (axis.backlash == 0) continue;
    const double slack = state.motor.position.value() - axis.countOf(joint.position[k]);
    const double taking_up = state.motor.velocity - joint.velocity[k] * axis.steps_per_unit;
    state.slack = static_cast<double>(restingCount(slack));
    const bool rests = std::abs(slack - state.slack) < kNearMicrostep &&
                       std::abs(taking_up) <= kStill * axis.limits.max_speed;
    if (!rests) return std::nullopt;
  }
  return states;
}

// The plan begins exactly where the axes are.
void QueuedPath::adjust(Start& start, const PathPoint& planned,
                        const std::vector<PathStart>& states) const {
  double square = 0.0;
  double way = 0.0;
  double speed = 0.0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    const PathAxis& axis = window_->axes[k];
    const PathStart& state = states[k];
    const double rate = planned.first[k];
    const double count = (state.motor.position - state.slack).value();
    square += rate * rate;
    way += rate * (axis.positionOf(count) - planned.position[k]);
    speed += rate * state.motor.velocity / axis.steps_per_unit;
  }
  if (start.on_straight) {
    start.begin.parameter = std::clamp(start.begin.parameter + way / square, 0.0, 1.0);
    start.begin.speed = speed / std::sqrt(square);
  } else if (speed > 0.0) {
    // The times of knots are rounded to nanoseconds.
    constexpr double kMost = 0.49e-9;
    start.begin.ago = std::clamp(way / speed, -kMost, kMost);
  }
}

// The first segment whose corner at the end is rounded into this one; this one if there is none.
std::size_t QueuedPath::firstRoundedInto(std::size_t segment) const {
  const std::vector<CurveSegment>& segments = window_->segments;
  std::size_t first = segment;
  double away = 0.0;
  for (std::size_t i = segment; i-- > 0 && segment - i <= kMostRounded;) {
    if (segments[i].blend.value_or(0.0) > away) first = i;
    if (segments[i].shape != CurveSegment::Shape::kLine) break;
    const std::vector<double>& from = i == 0 ? window_->start : segments[i - 1].end;
    away += lengthBetween(from, segments[i].end);
  }
  return first;
}

// The segments from this one on. Corners that are rounded at the start or before it stay as they
// are. The others may be rounded again, after the start.
std::vector<CurveSegment> QueuedPath::aroundStart(const Start& start, std::size_t first) const {
  const std::vector<CurveSegment>& old = window_->segments;
  std::vector<CurveSegment> made(old.begin() + static_cast<std::ptrdiff_t>(first), old.end());
  double away = 0.0;
  bool near = true;  // whether roundings may still reach the start
  for (std::size_t i = start.segment; i < old.size(); ++i) {
    CurveSegment& segment = made[i - first];
    const bool line = segment.shape == CurveSegment::Shape::kLine;
    near = near && (line || i == start.segment) && i <= start.segment + kMostRounded;
    if (near) {
      away += (i == start.segment ? 1.0 - start.begin.parameter : 1.0) *
              endRate(i == 0 ? window_->start : old[i - 1].end, segment);
      near = line;
      if (i + 1 < old.size() && segment.blend.value_or(0.0) > away) continue;
    }
    segment.blend.reset();
  }
  if (start.segment < old.size()) made[start.segment - first].kept = start.begin.parameter;
  return made;
}

// The motion along the rest of the path; empty if the axes can't follow it from there.
std::optional<QueuedPath::Continuation> QueuedPath::continueFrom(Start start, const Added& added,
                                                                 bool more_follows,
                                                                 int most_halvings) const {
  const std::vector<CurveSegment>& old = window_->segments;
  const std::vector<PathAxis>& axes = window_->axes;
  const bool smooth = hasJerkLimit(axes);
  const auto continuity = smooth ? Continuity::kCurvature : Continuity::kDirection;
  const std::size_t first = firstRoundedInto(start.segment);
  // The number of segments before that of the start.
  const std::size_t before = start.segment - first;
  const std::vector<double>& from = first == 0 ? window_->start : old[first - 1].end;
  std::vector<CurveSegment> segments = aroundStart(start, first);
  const std::size_t corner = segments.size();  // the number of the segment after it
  segments.insert(segments.end(), added.segments.begin(), added.segments.end());
  const double resolution = resolutionOf(axes);
  const std::vector<TimingLimits> limits = timingLimits(axes, kShareOfLimits);
  const bool in_last = corner == before + 1;
  if (in_last) segments[before].kept = start.begin.parameter;
  const Path given(from, segments, resolution, continuity, more_follows);
  PathPoint place;
  given.evaluate(before, start.begin.parameter, place);
  const auto states = statesAt(start, jointAt(start, place));
  if (!states) return std::nullopt;
  Continuation made;
  made.states = *states;
  adjust(start, place, made.states);
  for (int halvings = 0; halvings <= most_halvings; ++halvings) {
    if (corner > before) {
      const double kept = in_last ? start.begin.parameter : 0.0;
      const double left = halvings == kCornerHalvings ? 0.0 : std::ldexp(1.0 - kept, -halvings);
      segments[corner - 1].kept = 1.0 - left;
    }
    const Path path(from, segments, resolution, continuity, more_follows);
    const Path rest = path.part(before, segments.size() - 1);
    made.plan = smooth ? planJerkLimited(rest, limits, start.begin)
                       : planAccelerationLimited(rest, limits, start.begin);
    if (made.plan.excess * kShareOfLimits <= 1.0 + kNoExcessFromSpeed) {
      made.segments.assign(segments.begin() + static_cast<std::ptrdiff_t>(before), segments.end());
      setBlends(made.segments, path, before, made.plan.stops);
      made.marks = marksAfter(start, added);
      setPlaces(made.marks, start.segment, rest, made.plan.knots, start.time_ns);
      return made;
    }
    if (corner == before) break;
  }
  return std::nullopt;
}

bool QueuedPath::isBeyond(const PathMark& mark, const Start& start) {
  return mark.segment > start.segment ||
         (mark.segment == start.segment && mark.parameter > start.begin.parameter);
}

// Those that the new plan passes at other times: all new ones, and those beyond the start.
std::vector<PathMark> QueuedPath::marksAfter(const Start& start, const Added& added) const {
  std::vector<PathMark> marks;
  for (const PathMark& mark : window_->marks) {
    if (isBeyond(mark, start)) marks.push_back(mark);
  }
  for (PathMark& mark : marks) mark.appended_to = true;
  marks.insert(marks.end(), added.marks.begin(), added.marks.end());
  return marks;
}

QueuedPath::JointPlace QueuedPath::jointAt(const Start& start, const PathPoint& place) const {
  if (start.from_rest) {
    const std::vector<double>& end = window_->end();
    return {restOf(window_->axes, end, hasJerkLimit(window_->axes)).positions,
            std::vector<double>(end.size(), 0.0)};
  }
  double square = 0.0;
  for (const double rate : place.first) square += rate * rate;
  JointPlace joint{place.position, place.first};
  for (double& rate : joint.velocity) rate *= start.begin.speed / std::sqrt(square);
  return joint;
}

// The motion so far, without the part that is passed, and the new motion from the start on; null if
// there is no room to take up a backlash.
std::shared_ptr<const TrajectoryPath> QueuedPath::joined(
    const Start& start, const Continuation& continuation,
    const std::vector<TrajectoryPoint>& points, std::int64_t passed_ns,
    std::shared_ptr<const PathMarks> marks) const {
  const DoubleDouble passed = secondsOf(passed_ns);
  const std::int64_t origin_ns = splitNanoseconds(motion_->origin()).whole;
  std::vector<TrajectoryPath::Member> members = motion_->members();
  const bool smooth = hasJerkLimit(window_->axes);
  for (std::size_t k = 0; k < members.size(); ++k) {
    const PathAxis& axis = window_->axes[k];
    const PathStart& state = continuation.states[k];
    std::vector<Waypoint> waypoints;
    waypoints.reserve(points.size());
    for (const TrajectoryPoint& point : points) {
      const std::int64_t time_ns = nanoseconds(point.time);
      if (time_ns == 0) continue;  // it is the start
      Waypoint& waypoint = waypoints.emplace_back();
      waypoint.time_ns = time_ns;
      waypoint.position = withoutRounding(axis.countOf(point.positions[k]));
      waypoint.velocity = point.velocities[k] * axis.steps_per_unit;
      if (smooth) waypoint.acceleration = point.accelerations[k] * axis.steps_per_unit;
    }
    if (!waypoints.empty()) waypoints.back().may_rest = axis.shares_motors;
    MotionState joint_state{state.motor.position - state.slack, state.motor.velocity, 0.0};
    if (smooth) joint_state.acceleration = points.front().accelerations[k] * axis.steps_per_unit;
    Profile motor = planSpline(0, joint_state, waypoints, {axis.mostAcceleration()});
    if (axis.backlash > 0) {
      MotionLimits limits = axis.limits;
      limits.acceleration = axis.mostAcceleration();
      // After turns that are shorter than the backlash, the joint may lag behind the path.
      const auto taken = slackAt(*members[k].curve, start.time_ns - origin_ns, axis.backlash);
      MotorPlan plan = planMotor(motor, state.slack, axis.backlash, limits, taken);
      if (plan.no_room) return nullptr;
      motor = std::move(plan.profile);
    }
    std::vector<Piece> pieces;
    appendPieces(pieces, motion::part(*members[k].curve, passed - motion_->origin(),
                                      secondsOf(start.time_ns) - motion_->origin()));
    appendPieces(pieces, motor);
    const ProfilePeaks peaks = profilePeaks(motor, state.motor.velocity);
    for (MotorBounds* bounds : {&members[k].bounds, &members[k].stop_bounds}) {
      bounds->acceleration = std::max(bounds->acceleration, std::abs(peaks.acceleration.value));
      if (bounds->jerk > 0.0) bounds->jerk = std::max(bounds->jerk, largestJerk(motor));
    }
    members[k].curve = std::make_shared<const Profile>(0, std::move(pieces));
  }
  return std::make_shared<const TrajectoryPath>(std::move(members), passed, std::move(marks));
}

QueuedPath::Longer QueuedPath::extended(const std::vector<PathSegment>& segments, bool more_follows,
                                        double passed, double changeable) const {
  const auto unchanged = [&]() -> Longer {
    return {std::make_shared<const QueuedPath>(motion_, window_, more_follows), passed,
            motion_->end().value()};
  };
  if (segments.empty()) return unchanged();
  if (!more_follows_) throw Refused("the path is complete: it was told that no more follows");
  const std::int64_t passed_ns =
      std::max(nanoseconds(passed), splitNanoseconds(motion_->origin()).whole);
  const PathAhead ahead = aheadOf(static_cast<double>(passed_ns) * 1e-9);
  if (segments.size() > ahead.room) {
    throw Refused(fmt::format(
        "{} segments are too many: {} lie ahead of the axes, and there is room for {} more",
        segments.size(), ahead.segments, ahead.room));
  }
  try {
    const Added added = read(segments);
    if (added.empty()) return unchanged();
    if (added.segments.empty()) return withMarksAtEnd(added.marks, more_follows, passed);
    const std::int64_t changeable_ns = std::max(nanoseconds(changeable), passed_ns);
    const std::vector<Start> starts = startsFrom(changeable_ns);
    // With a jerk limit, a later start is better than a corner that is rounded less.
    for (const int halvings :
         {hasJerkLimit(window_->axes) ? 0 : kCornerHalvings, kCornerHalvings}) {
      for (const Start& start : starts) {
        if (start.begin.speed == 0.0 && halvings < kCornerHalvings) break;
        std::optional<Continuation> found = continueFrom(start, added, more_follows, halvings);
        if (!found) continue;
        Longer longer = continued(start, *std::move(found), added, more_follows, passed_ns);
        if (longer.path) return longer;
      }
    }
  } catch (const Malformed& error) {
    throw Refused(error.what());
  } catch (const TooLong& error) {
    throw Refused(error.what());
  }
  throw Refused(
      "the path turns, and continues so close to the limits of the axes that their backlash "
      "can't be taken up meanwhile");
}

QueuedPath::Longer QueuedPath::continued(const Start& start, Continuation continuation,
                                         const Added& added, bool more_follows,
                                         std::int64_t passed_ns) const {
  const double delay = start.from_rest.value_or(0.0);
  if (delay > 0.0) {
    const auto delay_ns = static_cast<std::int64_t>(std::ceil(delay * 1e9));
    for (TimingKnot& knot : continuation.plan.knots) knot.time_ns += delay_ns;
    for (PathMark& mark : continuation.marks) mark.place_ns += delay_ns;
    continuation.plan.settled_ns += delay_ns;
  }
  PathWindow window;
  window.frame = window_->frame;
  window.axes = window_->axes;
  // Leaves out the part that is passed.
  const auto first_kept =
      std::upper_bound(window_->knots.begin() + 1, window_->knots.end(), passed_ns,
                       [](std::int64_t time, const auto& knot) { return time < knot.time_ns; }) -
      1;
  std::size_t dropped = std::min(first_kept->segment, start.segment);
  dropped = firstRoundedInto(dropped);
  window.start = dropped == 0 ? window_->start : window_->segments[dropped - 1].end;
  window.segments.assign(window_->segments.begin() + static_cast<std::ptrdiff_t>(dropped),
                         window_->segments.begin() + static_cast<std::ptrdiff_t>(start.segment));
  window.segments.insert(window.segments.end(), continuation.segments.begin(),
                         continuation.segments.end());
  for (auto knot = first_kept; knot != window_->knots.end() && knot->time_ns < start.time_ns;
       ++knot) {
    window.knots.push_back(*knot);
    window.knots.back().segment -= dropped;
  }
  appendKnots(window.knots, continuation.plan.knots, start.time_ns, start.segment - dropped);
  window.settled_ns = start.time_ns + continuation.plan.settled_ns;
  keepMarks(window, start, dropped, std::move(continuation.marks), passed_ns);
  // Refusals count the segments from the first appended one.
  const std::size_t old = continuation.segments.size() - added.segments.size();
  for (std::size_t i = 0; i < old; ++i) continuation.segments[i].number = 0;
  const std::vector<TrajectoryPoint> points =
      pointsOf(std::move(continuation.plan.knots), window_->axes, window.segments.back().end,
               continuation.segments);
  continuation.plan.knots.clear();
  auto motion = joined(start, continuation, points, passed_ns,
                       marksByOutput(window.marks, *window.frame.outputs, window.marks_passed));
  if (!motion) return {};
  return {
      std::make_shared<const QueuedPath>(
          std::move(motion), std::make_shared<const PathWindow>(std::move(window)), more_follows),
      static_cast<double>(passed_ns) * 1e-9, static_cast<double>(start.time_ns) * 1e-9, true};
}

// Marks come after their places: by what a shaper delays, or because an output keeps its least
// times. So those that were passed long ago are left out, and no others.
void QueuedPath::keepMarks(PathWindow& window, const Start& start, std::size_t dropped,
                           std::vector<PathMark> later, std::int64_t passed_ns) const {
  constexpr std::int64_t kLongAgo = 60'000'000'000;
  std::int64_t margin = kLongAgo;
  for (const PathOutput& output : *window.frame.outputs) {
    margin = std::max({margin, kLongAgo + output.least_on.ns, kLongAgo + output.least_off.ns});
  }
  window.marks_passed = window_->marks_passed;
  window.marks_passed.resize(window.frame.outputs->size());
  for (const PathMark& mark : window_->marks) {
    if (isBeyond(mark, start)) continue;
    if (mark.place_ns < passed_ns - margin) {
      ++window.marks_passed[mark.output];
    } else {
      window.marks.push_back(mark);
      window.marks.back().appended_to = true;
    }
  }
  window.marks.insert(window.marks.end(), later.begin(), later.end());
  requireRates(window.marks, *window.frame.outputs);
  for (PathMark& mark : window.marks) {
    // Those of segments that are dropped are passed, wherever they were.
    if (mark.segment < dropped) mark.parameter = 0.0;
    mark.segment -= std::min(mark.segment, dropped);
  }
}

// What was appended leads nowhere, and switches outputs at the end of the path.
QueuedPath::Longer QueuedPath::withMarksAtEnd(std::vector<PathMark> added, bool more_follows,
                                              double passed) const {
  auto window = std::make_shared<PathWindow>(*window_);
  for (PathMark& mark : added) mark.place_ns = window_->knots.back().time_ns;
  for (PathMark& mark : window->marks) mark.appended_to = true;
  window->marks.insert(window->marks.end(), added.begin(), added.end());
  requireRates(window->marks, *window->frame.outputs);
  auto motion = std::make_shared<const TrajectoryPath>(
      motion_->members(), motion_->origin(),
      marksByOutput(window->marks, *window->frame.outputs, window->marks_passed));
  return {std::make_shared<const QueuedPath>(std::move(motion), std::move(window), more_follows),
          passed, motion_->end().value(), true};
}

}  // namespace stepdriver::motion
