#include "spline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "give_way.h"
#include "profile/double_piece.h"
#include "profile/hermite_cubic.h"
#include "spline_checks.h"
#include "spline_segment.h"

namespace stepdriver::motion {
namespace {

// If the acceleration of a quintic keeps a limit L, its fourth derivative is at most 96 L/T^2, and
// if its velocity keeps a limit L, at most 1536 L/T^3 (Markov's inequality for the derivatives of a
// cubic and of a polynomial of the fourth degree), so with this many cubics the errors are below
// kQuinticLimitError L.
constexpr double kMostCubics = 64.0;

Piece line(DoubleDouble duration, DoubleDouble from, DoubleDouble to) {
  return {duration, from, ((to - from) / duration).value(), 0.0, 0.0};
}

double reach(const Piece& piece) {
  const double t = piece.duration.value();
  return std::abs(piece.v0) * t + std::abs(piece.a) * t * t / 2.0 +
         std::abs(piece.j) * t * t * t / 6.0;
}

void appendCubics(std::vector<Piece>& pieces, const SplineSegment& segment, const Quintic& curve,
                  double count) {
  const DoubleDouble duration = segment.duration();
  const DoubleDouble part = duration / DoubleDouble(count);
  DoubleDouble from = segment.begin.position;
  double v0 = *segment.begin.velocity;
  for (double k = 1.0; k < count; ++k) {
    const DoubleDouble u = DoubleDouble(k) / DoubleDouble(count);
    const DoubleDouble to = curve.positionAt(u);
    const double v1 = (curve.slopeAt(u) / duration).value();
    pieces.push_back(cubic(part, from, v0, to, v1));
    from = to;
    v0 = v1;
  }
  pieces.push_back(cubic(part, from, v0, segment.end.position, *segment.end.velocity));
}

// Whether one of the pieces from an index on exceeds a limit.
bool exceeds(const std::vector<Piece>& pieces, std::size_t from, double acceleration,
             double speed) {
  const auto first = pieces.begin() + static_cast<std::ptrdiff_t>(from);
  return std::any_of(first, pieces.end(), [&](const Piece& piece) {
    const DoublePiece rough(piece);
    return rough.highestAcceleration(0.0, rough.duration) > acceleration ||
           rough.highestSpeed(0.0, rough.duration) > speed;
  });
}

void appendQuintic(std::vector<Piece>& pieces, const SplineSegment& segment,
                   const SplineLimits& limits) {
  const Quintic curve = segment.quintic();
  requireReach(curve.reach(), segment.index);
  const double fourth = curve.largestFourthDerivative();
  const double duration = segment.duration().value();
  const std::size_t before = pieces.size();
  // A limit that an error no longer takes the cubics above.
  constexpr double kAny = std::numeric_limits<double>::infinity();
  const auto counts = [](double limit, double error) {
    return error <= kQuinticLimitError * limit ? kAny : limit;
  };
  for (double count = cubicsFor(1.0, fourth, kQuinticError);; count *= 2.0) {
    appendCubics(pieces, segment, curve, count);
    const double h = duration / count;
    const double jolt = fourth / std::pow(duration, 4.0);
    const double acceleration = counts(limits.acceleration, h * h / 12.0 * jolt);
    const double speed = counts(limits.speed, std::sqrt(3.0) / 216.0 * h * h * h * jolt);
    if (count >= kMostCubics || !exceeds(pieces, before, acceleration, speed)) break;
    pieces.resize(before);
  }
}

// @pre kind() is kCubic
Piece cubicOf(const SplineSegment& segment) {
  return cubic(segment.duration(), segment.begin.position, *segment.begin.velocity,
               segment.end.position, *segment.end.velocity);
}

// The motion of a segment whose largest acceleration is the smallest possible one: its velocity
// changes evenly to a velocity v, which it keeps for a while, and then changes evenly to the
// velocity at the end.
struct GentlestMotion {
  double change = 0.0;    // [s] the time until v is reached
  double velocity = 0.0;  // [microsteps/s] v
  double keep = 0.0;      // [s] how long v is kept
};

// Let c = p1 - p0 - (v0 + v1) T/2 be the way that a constant acceleration would miss, and
// u = v1 - v0. Without a limit of the speed, the acceleration is x for a time (T + u/x)/2 and then
// -x. It has the sign of c, and x^2 T^2/4 - c x - u^2/4 = 0. With the limit V, it is
// ((V - v0)^2 + (V - v1)^2)/(2 (V T - (p1 - p0))) on both sides of V.
GentlestMotion gentlestMotion(const SplineSegment& segment, double most_speed) {
  const double time = segment.duration().value();
  const double v0 = *segment.begin.velocity;
  const double v1 = *segment.end.velocity;
  const double way = (segment.end.position - segment.begin.position).value();
  const double missed = way - (v0 + v1) * time / 2.0;
  const double sign = missed < 0.0 ? -1.0 : 1.0;
  const double x =
      sign * 2.0 * (std::abs(missed) + std::hypot(missed, time * (v1 - v0) / 2.0)) / (time * time);
  if (x == 0.0) return {0.0, v0, time};
  const double change = std::clamp((time + (v1 - v0) / x) / 2.0, 0.0, time);
  const double peak = v0 + x * change;
  // The velocities that the sender gave aren't changed.
  const double limit = sign * std::max({most_speed, sign * v0, sign * v1});
  if (sign * peak <= sign * limit) return {change, peak, 0.0};
  const double before = limit - v0;
  const double after = limit - v1;
  const double least = (before * before + after * after) / (2.0 * (limit * time - way));
  const double up = before / least;
  const double down = after / least;
  // Otherwise even the mean velocity would be beyond the limit.
  if (!(up >= 0.0 && down >= 0.0 && up + down <= time)) return {change, peak, 0.0};
  return {up, limit, time - up - down};
}

void appendGentlest(std::vector<Piece>& pieces, const SplineSegment& segment, double most_speed) {
  // Relative to the duration of a segment: a shorter stretch is left out, which changes the
  // accelerations of the others by less than four times this part.
  constexpr double kNothing = 1e-6;
  const GentlestMotion motion = gentlestMotion(segment, most_speed);
  const DoubleDouble duration = segment.duration();
  const double shortest = kNothing * duration.value();
  DoubleDouble done = 0.0;
  DoubleDouble from = segment.begin.position;
  double v = *segment.begin.velocity;
  const auto change_until = [&](double time) {
    const DoubleDouble part = DoubleDouble(time) - done;
    if (part.value() < shortest || duration.value() - time < shortest) return;
    const DoubleDouble to = from + part * DoubleDouble((v + motion.velocity) / 2.0);
    pieces.push_back(cubic(part, from, v, to, motion.velocity));
    done = DoubleDouble(time);
    from = to;
    v = motion.velocity;
  };
  change_until(motion.change);
  change_until(motion.change + motion.keep);
  pieces.push_back(cubic(duration - done, from, v, segment.end.position, *segment.end.velocity));
}

void appendCubic(std::vector<Piece>& pieces, const SplineSegment& segment) {
  pieces.push_back(cubicOf(segment));
  requireReach(reach(pieces.back()), segment.index);
}

// Replaces the curve of a segment, which is the pieces from an index on, by the first gentler curve
// that keeps to the limits. If none does, it stays.
void makeGentler(std::vector<Piece>& pieces, std::size_t from, const SplineSegment& segment,
                 const SplineLimits& limits) {
  const double most = limits.gentler_beyond;
  const auto keeps_limits = [&] {
    return !exceeds(pieces, from, most * limits.acceleration, most * limits.speed);
  };
  if (keeps_limits()) return;
  const auto first = pieces.begin() + static_cast<std::ptrdiff_t>(from);
  const std::vector<Piece> given(first, pieces.end());
  pieces.resize(from);
  pieces.push_back(cubicOf(segment));
  if (keeps_limits()) return;
  pieces.resize(from);
  appendGentlest(pieces, segment, limits.speed);
  if (keeps_limits()) return;
  pieces.resize(from);
  pieces.insert(pieces.end(), given.begin(), given.end());
}

void append(std::vector<Piece>& pieces, const SplineSegment& segment, const SplineLimits& limits) {
  const std::size_t before = pieces.size();
  switch (segment.kind()) {
    case SegmentKind::kLine:
      pieces.push_back(line(segment.duration(), segment.begin.position, segment.end.position));
      return;
    case SegmentKind::kCubic:
      appendCubic(pieces, segment);
      break;
    case SegmentKind::kQuintic:
      appendQuintic(pieces, segment, limits);
      break;
  }
  if (std::isfinite(limits.gentler_beyond)) makeGentler(pieces, before, segment, limits);
}

// The accelerations at a segment's ends [microsteps/s^2].
struct Ends {
  double begin = 0.0;
  double end = 0.0;
};

Ends includeJerk(SplineJerk& worst, const SplineSegment& segment, const Piece* made = nullptr) {
  const double start = static_cast<double>(segment.begin.time_ns) * 1e-9;
  const auto include = [&](double jerk, double time_s) {
    if (std::abs(jerk) > std::abs(worst.jerk.value)) worst.jerk = {jerk, time_s};
  };
  if (segment.kind() == SegmentKind::kLine) return {};
  if (segment.kind() == SegmentKind::kCubic) {
    const DoublePiece piece(made != nullptr ? *made : cubicOf(segment));
    include(piece.j, start);
    return {piece.a, piece.acceleration(piece.duration)};
  }
  const double duration = segment.duration().value();
  const Quintic curve = segment.quintic();
  const auto consider = [&](double u) {
    include(curve.thirdDerivativeAt(u) / (duration * duration * duration), start + u * duration);
  };
  consider(0.0);
  consider(1.0);
  const double level = -curve.c4.value() / (5.0 * curve.c5.value());
  if (level > 0.0 && level < 1.0) consider(level);
  return {*segment.begin.acceleration, *segment.end.acceleration};
}

// Collects the demands of one segment after the other.
class JerkMeter {
 public:
  explicit JerkMeter(double acceleration_before) : before_(acceleration_before) {}

  /// @param made the cubic of the segment, if it has been made already.
  void add(const SplineSegment& segment, const Piece* made = nullptr) {
    const Ends ends = includeJerk(worst_, segment, made);
    jumpTo(ends.begin, segment.begin.time_ns);
    before_ = ends.end;
  }
  void jumpTo(double acceleration, std::int64_t time_ns) {
    const double change = acceleration - before_;
    if (std::abs(change) > std::abs(worst_.acceleration_jump.value)) {
      worst_.acceleration_jump = {change, static_cast<double>(time_ns) * 1e-9};
    }
  }
  const SplineJerk& worst() const { return worst_; }

 private:
  SplineJerk worst_;
  double before_;
};

double accelerationAtBegin(const SplineSegment& segment) {
  SplineJerk ignored;
  return includeJerk(ignored, segment).begin;
}

}  // namespace

Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints, const SplineLimits& limits) {
  requirePlannable(from, waypoints);
  const SplineSegments segments(waypoints);
  std::vector<Piece> pieces;
  pieces.reserve(waypoints.size());
  append(pieces, segments.first(from), limits);
  for (std::size_t i = 1; i < segments.size(); ++i) {
    append(pieces, segments.at(i), limits);
  }
  return {start_ns, std::move(pieces)};
}

SplineJerk splineJerk(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  requirePlannable(from, waypoints);
  const SplineSegments segments(waypoints);
  JerkMeter meter(from.acceleration);
  meter.add(segments.first(from));
  for (std::size_t i = 1; i < segments.size(); ++i) meter.add(segments.at(i));
  meter.jumpTo(0.0, waypoints.back().time_ns);
  return meter.worst();
}

SplineTail::SplineTail(const std::vector<Waypoint>& waypoints, const SplineLimits& limits)
    : limits_(limits) {
  requireWaypoints(waypoints);
  const SplineSegments segments(waypoints);
  SplineSegment segment = segments.first({});
  first_index_ = segment.index;
  first_ = waypoints[segment.index];
  first_.position = segment.end.position.value();
  if (segments.size() == 1) return;
  std::vector<Piece> pieces;
  pieces.reserve(waypoints.size());
  begin_acceleration_ = accelerationAtBegin(segments.at(1));
  JerkMeter meter(begin_acceleration_);
  for (std::size_t i = 1; i < segments.size(); ++i) {
    giveWayAt(i);
    segments.advance(segment);
    const std::size_t before = pieces.size();
    append(pieces, segment, limits);
    meter.add(segment, pieces.size() == before + 1 ? &pieces.back() : nullptr);
  }
  meter.jumpTo(0.0, waypoints.back().time_ns);
  profile_.emplace(0, std::move(pieces));
  jerk_ = meter.worst();
  jerk_.jerk.time_s -= beginS();
  jerk_.acceleration_jump.time_s -= beginS();
}

std::vector<Piece> SplineTail::head(const MotionState& from) const {
  requireStart(from);
  std::vector<Piece> pieces;
  append(pieces,
         {{0, from.position, from.velocity, from.acceleration},
          {first_.time_ns, first_.position, first_.velocity, first_.acceleration},
          first_index_},
         limits_);
  return pieces;
}

SplineJerk SplineTail::headJerk(const MotionState& from) const {
  JerkMeter meter(from.acceleration);
  meter.add({{0, from.position, from.velocity, from.acceleration},
             {first_.time_ns, first_.position, first_.velocity, first_.acceleration},
             first_index_});
  meter.jumpTo(begin_acceleration_, first_.time_ns);
  return meter.worst();
}

}  // namespace stepdriver::motion
