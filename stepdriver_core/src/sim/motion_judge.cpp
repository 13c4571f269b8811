#include "motion_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stepdriver::sim {
namespace {

// [ns] Between two times, each rounded to a nanosecond.
constexpr std::int64_t kTimeError = 1;

double seconds(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) * 1e-9; }

}  // namespace

MotionJudge::MotionJudge(const MotorLimits& limits)
    : rate_(limits.rate * kMore),
      acceleration_(limits.acceleration * kMore),
      start_rate_(limits.start_rate * kMore),
      late_(limits.late) {}

void MotionJudge::forget() { forgets_ = kMostCaughtUp + 1; }

std::optional<Violation> MotionJudge::step(double way, std::int64_t time_ns,
                                           std::int64_t slides_ns) {
  Edge edge;
  edge.place = position_ + way / 2.0;
  edge.time_ns = time_ns;
  edge.slides_ns = slides_ns;
  position_ += way;
  if (forgets_ > 0) {
    --forgets_;
    steps_ = 0;
    scales_ = {};
    return std::nullopt;
  }
  const double step = std::abs(way);
  if (scales_[0].known > 0) rest(scales_[0].ends[0], edge, step);

  std::optional<Violation> violation;
  for (std::size_t n = 0; n < kScales && (steps_ >> n << n) == steps_; ++n) {
    Scale& scale = scales_.at(n);
    scale.ends = {edge, scale.ends[0], scale.ends[1]};
    scale.known = std::min(scale.known + 1, 3);
    std::optional<Violation> found;
    if (scale.known > 1 && isTooFast(scale.ends[1], edge, step)) {
      found = Violation::kAboveTopRate;
    } else if (scale.known > 2 && late_ == 0.0 && isTooSudden(scale, step)) {
      found = Violation::kAboveAcceleration;
    }
    if (!found || violation) continue;
    violation = found;
    if (first_violation_.empty()) note(*found, scale, std::size_t{1} << n);
  }
  ++steps_;
  return violation;
}

// From rest on a whole step, the next line is half a step away: v t + a t^2/2 = step/2, but not
// above the top rate.
void MotionJudge::rest(const Edge& last, Edge& next, double step) const {
  const double start =
      std::max(step / (std::sqrt(start_rate_ * start_rate_ + acceleration_ * step) + start_rate_),
               0.5 * step / rate_);
  const bool may_have_rested = seconds(next.time_ns - last.time_ns + kTimeError) >= start;
  next.rests = last.rests + (may_have_rested ? 1 : 0);
  next.since_ns = may_have_rested ? next.time_ns : last.since_ns;
}

// If steps end at once, the next motion begins at a whole step, up to half a step ahead of the one
// before it. (Never twice in a window: each of these ends would have to come right after a step,
// and a new request after it.) If the first of them was late, what was open then may come too.
bool MotionJudge::isTooFast(const Edge& from, const Edge& to, double step) const {
  const double ahead = from.rests != to.rests ? 0.5 : 0.0;
  const double way = std::abs(to.place - from.place) - (ahead + 2.0 * kPlaceError) * step - late_;
  return way > rate_ * seconds(to.time_ns - from.time_ns + kTimeError);
}

// The true time between the steps is in the interval from `shortest` to the seen one, and the true
// distance differs by the errors of both places.
MotionJudge::Mean MotionJudge::meanOf(const Edge& from, const Edge& to, double step) {
  const std::int64_t seen = to.time_ns - from.time_ns;
  const std::int64_t uncertain = to.slides_ns - from.slides_ns + kTimeError;
  const double way = std::abs(to.place - from.place);
  const double shortest = seconds(std::max<std::int64_t>(seen - uncertain, 0));
  Mean mean;
  mean.seconds = seconds(seen + kTimeError);
  mean.velocity = (to.place - from.place) / seconds(std::max<std::int64_t>(seen, 1));
  mean.error = (way + 2.0 * kPlaceError * step) / shortest - std::abs(mean.velocity);
  return mean;
}

bool MotionJudge::isTooSudden(const Scale& scale, double step) const {
  const auto& [end, middle, begin] = scale.ends;
  const Mean before = meanOf(begin, middle, step);
  const Mean after = meanOf(middle, end, step);
  if (begin.rests == end.rests) {
    const double most = acceleration_ * (before.seconds + after.seconds) / 2.0 + 2.0 * start_rate_;
    return std::abs(after.velocity - before.velocity) - before.error - after.error > most;
  }
  // It may have come to rest at once; then it speeds up again. At the step after the rest it moves
  // at most at 3/2 sqrt(a step): with an interval t, at most at step/t + a t/2.
  if (middle.rests != end.rests) return false;
  const double since = seconds(middle.time_ns - end.since_ns + kTimeError);
  const double most = 1.5 * std::sqrt(acceleration_ * step) + 2.0 * start_rate_ +
                      acceleration_ * (since + after.seconds / 2.0);
  return std::abs(after.velocity) - after.error > most;
}

void MotionJudge::note(Violation violation, const Scale& scale, std::size_t steps) {
  const auto& [end, middle, begin] = scale.ends;
  first_violation_ =
      fmt::format("{} at {:.9f} s: {:g} steps in {} ns", nameOf(violation), seconds(end.time_ns),
                  end.place - middle.place, end.time_ns - middle.time_ns);
  if (violation == Violation::kAboveTopRate) {
    first_violation_ += fmt::format(", at most {:g} steps/s", rate_);
    return;
  }
  first_violation_ +=
      fmt::format(", after {:g} in {} ns ({} edges each), at most {:g} steps/s^2",
                  middle.place - begin.place, middle.time_ns - begin.time_ns, steps, acceleration_);
}

}  // namespace stepdriver::sim
