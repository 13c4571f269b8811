#include "setpoint_stream.h"

#include <algorithm>

namespace stepdriver::motion {
namespace {

constexpr std::int64_t kShortestPeriod = 1'000'000;
// The period of the slowest stream, 20 Hz, plus half of it for a message that comes late. Setpoints
// at longer intervals are single positions: a velocity between them would lead beyond the last one.
constexpr std::int64_t kLongestInterval = 75'000'000;
// A time is smoothed into the future by no more than this, because that delays the motion.
constexpr std::int64_t kMostDelay = 1'000'000;
// The part of a deviation from the expected time that changes the estimate.
constexpr std::int64_t kTimePart = 4;
constexpr std::int64_t kPeriodPart = 16;
// A single long or short interval changes the period by at most this factor.
constexpr std::int64_t kMostChange = 4;

// Smooths the time of a setpoint that came `late` after the expected time.
void smooth(SetpointStream::Course& course, std::int64_t expected, std::int64_t late) {
  const std::int64_t period = course.period_ns;
  if (late > period / 2) {  // one was lost, or they come at longer intervals now
    course.came_ns = expected + late;
    if (late > 2 * period) course.period_ns = std::min(period + late, kMostChange * period);
  } else if (late < -period / 2) {  // they come at shorter intervals now
    course.came_ns = expected - period / 2;
    course.period_ns = std::max(period + late, period / kMostChange);
  } else {
    course.came_ns = expected + late / kTimePart;
    course.period_ns = period + late / kPeriodPart;
  }
  course.period_ns = std::max(course.period_ns, kShortestPeriod);
}

}  // namespace

SetpointStream::Course SetpointStream::add(double position, std::int64_t now,
                                           std::int64_t timeout_ns, std::uint64_t stops) {
  const bool continues = last_ && last_->stops == stops && now >= last_->arrived_ns &&
                         now - last_->arrived_ns < std::min(timeout_ns, kLongestInterval);
  Course course;
  course.came_ns = now;
  if (continues) {
    course = last_->course;
    if (course.period_ns == 0) {
      course.period_ns = std::max(now - course.came_ns, kShortestPeriod);
      course.came_ns = now;
    } else {
      const std::int64_t expected = course.came_ns + course.period_ns;
      smooth(course, expected, now - expected);
      course.came_ns = std::min(course.came_ns, now + kMostDelay);
    }
    const std::int64_t passed =
        std::max(course.came_ns - last_->course.came_ns, course.period_ns / 4);
    course.velocity = (position - last_->position) / (static_cast<double>(passed) * 1e-9);
  }
  last_ = Last{position, now, course, stops};
  return course;
}

}  // namespace stepdriver::motion
