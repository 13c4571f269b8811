#include "motion/spline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "give_way.h"
#include "hermite.h"
#include "rough_piece.h"
#include "spline_refusals.h"
#include "spline_segment.h"

namespace stepdriver::motion {
namespace {

// If the acceleration of a quintic keeps a limit L, its fourth derivative is at most 96 L/T^2
// (Markov's inequality for the second derivative of a cubic), so with this many cubics the error of
// the acceleration is below kQuinticAccelerationError L.
constexpr double kMostCubics = 64.0;

Piece line(DoubleDouble duration, DoubleDouble from, DoubleDouble to) {
  return {duration, from, ((to - from) / duration).value(), 0.0, 0.0};
}

double reach(const Piece& piece) {
  const double t = piece.duration.value();
  return std::abs(piece.v0) * t + std::abs(piece.a) * t * t / 2.0 +
         std::abs(piece.j) * t * t * t / 6.0;
}

void appendCubics(std::vector<Piece>& pieces, const Segment& segment, const Quintic& curve,
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

bool exceeds(std::vector<Piece>::const_iterator piece, std::vector<Piece>::const_iterator end,
             double acceleration) {
  return std::any_of(piece, end, [&](const Piece& cubic) {
    const RoughPiece rough(cubic);
    return rough.highestAcceleration(0.0, rough.duration) > acceleration;
  });
}

void appendQuintic(std::vector<Piece>& pieces, const Segment& segment, double most_acceleration) {
  const Quintic curve = segment.quintic();
  requireReach(curve.reach(), segment.index);
  const double fourth = curve.largestFourthDerivative();
  const double duration = segment.duration().value();
  const auto before = static_cast<std::ptrdiff_t>(pieces.size());
  for (double count = cubicsFor(1.0, fourth, kQuinticError);; count *= 2.0) {
    appendCubics(pieces, segment, curve, count);
    const double h = 1.0 / count;
    const double error = h * h / 12.0 * fourth / (duration * duration);
    if (error <= kQuinticAccelerationError * most_acceleration || count >= kMostCubics) break;
    if (!exceeds(pieces.begin() + before, pieces.end(), most_acceleration)) break;
    pieces.resize(static_cast<std::size_t>(before));
  }
}

// @pre kind() is kCubic
Piece cubicOf(const Segment& segment) {
  return cubic(segment.duration(), segment.begin.position, *segment.begin.velocity,
               segment.end.position, *segment.end.velocity);
}

void append(std::vector<Piece>& pieces, const Segment& segment, double most_acceleration) {
  const Knot& begin = segment.begin;
  const Knot& end = segment.end;
  switch (segment.kind()) {
    case SegmentKind::kLine:
      pieces.push_back(line(segment.duration(), begin.position, end.position));
      break;
    case SegmentKind::kCubic:
      pieces.push_back(cubicOf(segment));
      requireReach(reach(pieces.back()), segment.index);
      break;
    case SegmentKind::kQuintic:
      appendQuintic(pieces, segment, most_acceleration);
      break;
  }
}

// The accelerations at a segment's ends [microsteps/s^2].
struct Ends {
  double begin = 0.0;
  double end = 0.0;
};

Ends takeJerk(SplineJerk& worst, const Segment& segment, const Piece* made = nullptr) {
  const double start = static_cast<double>(segment.begin.time_ns) * 1e-9;
  const auto take = [&](double jerk, double time_s) {
    if (std::abs(jerk) > std::abs(worst.jerk.value)) worst.jerk = {jerk, time_s};
  };
  if (segment.kind() == SegmentKind::kLine) return {};
  if (segment.kind() == SegmentKind::kCubic) {
    const RoughPiece piece(made != nullptr ? *made : cubicOf(segment));
    take(piece.j, start);
    return {piece.a, piece.acceleration(piece.duration)};
  }
  const double duration = segment.duration().value();
  const Quintic curve = segment.quintic();
  const auto consider = [&](double u) {
    take(curve.thirdDerivativeAt(u) / (duration * duration * duration), start + u * duration);
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

  /// @param made the cubic of the segment, if it has been made.
  void take(const Segment& segment, const Piece* made = nullptr) {
    const Ends ends = takeJerk(worst_, segment, made);
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

double accelerationAtBegin(const Segment& segment) {
  SplineJerk ignored;
  return takeJerk(ignored, segment).begin;
}

}  // namespace

Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints, double most_acceleration) {
  requirePlannable(from, waypoints);
  const Segments segments(waypoints);
  std::vector<Piece> pieces;
  pieces.reserve(waypoints.size());
  append(pieces, segments.first(from), most_acceleration);
  for (std::size_t i = 1; i < segments.size(); ++i) {
    append(pieces, segments.at(i), most_acceleration);
  }
  return {start_ns, std::move(pieces)};
}

SplineJerk splineJerk(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  requirePlannable(from, waypoints);
  const Segments segments(waypoints);
  JerkMeter meter(from.acceleration);
  meter.take(segments.first(from));
  for (std::size_t i = 1; i < segments.size(); ++i) meter.take(segments.at(i));
  meter.jumpTo(0.0, waypoints.back().time_ns);
  return meter.worst();
}

SplineTail::SplineTail(const std::vector<Waypoint>& waypoints, double most_acceleration)
    : most_acceleration_(most_acceleration) {
  requireWaypoints(waypoints);
  const Segments segments(waypoints);
  Segment segment = segments.first({});
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
    append(pieces, segment, most_acceleration);
    meter.take(segment, &pieces.back());
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
         most_acceleration_);
  return pieces;
}

SplineJerk SplineTail::headJerk(const MotionState& from) const {
  JerkMeter meter(from.acceleration);
  meter.take({{0, from.position, from.velocity, from.acceleration},
              {first_.time_ns, first_.position, first_.velocity, first_.acceleration},
              first_index_});
  meter.jumpTo(begin_acceleration_, first_.time_ns);
  return meter.worst();
}

}  // namespace stepdriver::motion
