#include "motion/braking.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "motion/double_double.h"
#include "motion/rate.h"

namespace stepdriver::motion {
namespace {

constexpr double kGentlerSlope = 0.9;
constexpr int kSlopeTries = 20;

// The steepest fall of the rate that a motor allows at a place [1/s].
double steepestAt(const BoundCourse& course, DoubleDouble place, double rate) {
  const MotionState state = course.curve->stateAt(splitNanoseconds(place).whole);
  const double speed = std::abs(state.velocity);
  const double with = std::copysign(state.acceleration, state.acceleration * state.velocity);
  const double room = course.bounds.acceleration + with * rate * rate;
  return kSteepestSlope * speed <= room ? kSteepestSlope : std::max(room, 0.0) / speed;
}

bool stopsWithin(double slice, DoubleDouble rate, double slope) {
  return rate.value() <= slope * slice;
}

// A time of a constant slope: a slice, or until the rate is 0.
Piece slowing(DoubleDouble place, DoubleDouble rate, double slope, double slice) {
  const bool stops = stopsWithin(slice, rate, slope);
  const DoubleDouble duration = stops ? rate / DoubleDouble(slope) : DoubleDouble(slice);
  return {duration, place, rate.hi, -slope, 0.0, rate.lo};
}

bool keep(const std::vector<BoundCourse>& courses, const Piece& piece) {
  const Profile path(0, {piece});
  return std::all_of(courses.begin(), courses.end(), [&](const BoundCourse& course) {
    return staysWithin(*course.curve, path, course.bounds);
  });
}

// That all motors allow in the whole slice.
double steepestSlope(const std::vector<BoundCourse>& courses, DoubleDouble place, DoubleDouble rate,
                     double slice) {
  double slope = kSteepestSlope;
  const auto limit_at = [&](DoubleDouble there, double rate_there) {
    for (const BoundCourse& course : courses) {
      slope = std::min(slope, steepestAt(course, there, rate_there));
    }
  };
  limit_at(place, rate.value());
  const Piece first = slowing(place, rate, slope, slice);
  limit_at(first.positionAt(first.duration), first.velocityAt(first.duration).value());
  for (int i = 0; i < kSlopeTries; ++i, slope *= kGentlerSlope) {
    if (keep(courses, slowing(place, rate, slope, slice))) return slope;
  }
  return 0.0;
}

}  // namespace

std::optional<Profile> planBraking(std::int64_t start_ns, const MotionState& from,
                                   const std::vector<BoundCourse>& courses, double slice,
                                   double most, DoubleDouble end) {
  std::vector<Piece> pieces;
  DoubleDouble place = from.position;
  DoubleDouble rate = from.velocity;
  for (double time = 0.0; time < most; time += slice) {
    if (!(place + rate * DoubleDouble(slice) < end)) return std::nullopt;
    const double slope = steepestSlope(courses, place, rate, slice);
    const Piece& piece = pieces.emplace_back(slowing(place, rate, slope, slice));
    if (stopsWithin(slice, rate, slope)) {
      if (time + piece.duration.value() >= most) return std::nullopt;
      return Profile(start_ns, std::move(pieces));
    }
    place = piece.positionAt(piece.duration);
    rate = piece.velocityAt(piece.duration);
  }
  return std::nullopt;
}

}  // namespace stepdriver::motion
