#include "stepdriver_core/motion/step_finder.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {
namespace {

// From this time on a double's 53 bits leave more than 1/32 ns of doubt.
constexpr double kFarNs = 281474976710656.0;  // 2^48, 78 hours

}  // namespace

StepFinder::StepFinder(const Profile& profile, std::int64_t count)
    : profile_(&profile), count_(count) {}

bool StepFinder::next(Step& step) {
  while (stretch_.steps_left == 0) {
    if (!enterNext()) return false;
  }
  Stretch& stretch = stretch_;
  const double half = stretch.direction * 0.5;
  const double line = static_cast<double>(count_ - stretch.anchor_position.whole) + half;
  const double way = stretch.direction * stretch.time_sign * (line - stretch.anchor_position.rest);
  const double t = timeFromAnchor(way);
  std::int64_t time = 0;
  if (t * 1e9 < kFarNs) {
    time = stretch.anchor_ns.whole +
           std::llrint(stretch.anchor_ns.rest + stretch.time_sign * (t * 1e9));
  } else {
    time = refined(t, line);
  }
  time = std::clamp(time, stretch.begin_ns, stretch.end_ns);
  stretch.last = t;
  stretch.begin_ns = time;
  --stretch.steps_left;

  step.time_ns = profile_->startNs() + time;
  step.direction = stretch.direction > 0.0 ? 1 : -1;
  count_ += step.direction;
  return true;
}

bool StepFinder::enterNext() {
  if (profile_ == nullptr || piece_ >= profile_->pieces().size()) return false;
  const Piece& piece = profile_->pieces()[piece_];
  const double end = piece.duration.value();
  const double turn = piece.firstTurn(done_);
  const DoubleDouble begin = done_;
  const DoubleDouble stretch_end = turn < end ? DoubleDouble(turn) : piece.duration;
  enter(piece, begin, stretch_end, profile_->pieceStart(piece_));
  if (turn < end) {
    done_ = turn;
  } else {
    ++piece_;
    done_ = 0.0;
  }
  return true;
}

void StepFinder::enter(const Piece& piece, DoubleDouble begin, DoubleDouble end,
                       DoubleDouble piece_start) {
  stretch_.steps_left = 0;
  const DoubleDouble from = piece.positionAt(begin);
  const DoubleDouble to = piece.positionAt(end);
  const DoubleDouble way = to - from;
  if (way.hi == 0.0) return;
  const double direction = way.hi > 0.0 ? 1.0 : -1.0;

  // The last line that is crossed, not just touched: the largest k - 1/2 below `to` going up.
  const Split goal = split(to);
  const std::int64_t reached =
      direction > 0.0 ? goal.whole + static_cast<std::int64_t>(std::ceil(goal.rest - 0.5))
                      : goal.whole + static_cast<std::int64_t>(std::floor(goal.rest + 0.5));
  const std::int64_t steps = direction > 0.0 ? reached - count_ : count_ - reached;
  if (steps <= 0) return;

  const double v_begin = direction * piece.velocityAt(begin).value();
  const double v_end = direction * piece.velocityAt(end).value();
  const bool backwards = v_end < v_begin;
  const DoubleDouble anchor = backwards ? end : begin;
  const double acceleration = piece.accelerationAt(anchor).value();

  stretch_.direction = direction;
  stretch_.time_sign = backwards ? -1.0 : 1.0;
  stretch_.anchor_ns = splitNanoseconds(piece_start + anchor);
  stretch_.anchor_position = backwards ? goal : split(from);
  stretch_.v = std::max(0.0, backwards ? v_end : v_begin);
  stretch_.a = stretch_.time_sign * direction * acceleration;
  stretch_.j = direction * piece.j;
  stretch_.duration = (end - begin).value();
  stretch_.last = backwards ? stretch_.duration : 0.0;
  stretch_.begin_ns = splitNanoseconds(piece_start + begin).whole;
  stretch_.end_ns = splitNanoseconds(piece_start + end).whole;
  stretch_.steps_left = steps;
}

double StepFinder::timeFromAnchor(double way) {
  if (!(way > 0.0)) return 0.0;
  const Stretch& s = stretch_;
  if (s.j != 0.0) return solveCubic(way);
  if (s.a == 0.0) return way / s.v;
  return 2.0 * way / (s.v + std::sqrt(s.v * s.v + 2.0 * s.a * way));
}

double StepFinder::solveCubic(double way) const {
  const Stretch& s = stretch_;
  double low = s.time_sign > 0.0 ? s.last : 0.0;
  double high = s.time_sign > 0.0 ? s.duration : s.last;
  const auto way_at = [&s](double t) { return t * (s.v + t * (s.a / 2.0 + t * (s.j / 6.0))); };
  const auto speed_at = [&s](double t) { return s.v + t * (s.a + t * (s.j / 2.0)); };

  double t = s.last;
  double speed = speed_at(t);
  // 100 halvings end at the last bit wherever Newton's steps leave the bracket every time.
  for (int i = 0; i < 100; ++i) {
    const double error = way_at(t) - way;
    if (error == 0.0) return t;
    (error < 0.0 ? low : high) = t;
    double better = t - error / speed;
    if (!(better > low && better < high)) better = low + (high - low) / 2.0;
    if (better == t || std::abs(better - t) <= 2e-16 * high) return better;
    t = better;
    speed = speed_at(t);
  }
  return t;
}

std::int64_t StepFinder::refined(double t, double line) const {
  const Stretch& s = stretch_;
  const Piece seen{DoubleDouble(s.duration), DoubleDouble(0.0), s.v, s.a, s.j};
  const DoubleDouble way = DoubleDouble(s.direction * s.time_sign) *
                           (DoubleDouble(line) - DoubleDouble(s.anchor_position.rest));
  const double correction =
      (way - seen.positionAt(DoubleDouble(t))).value() / seen.velocityAt(DoubleDouble(t)).value();
  const DoubleDouble exact = DoubleDouble(t) + DoubleDouble(correction);
  const Split ns = splitNanoseconds(DoubleDouble(s.time_sign) * exact);
  return s.anchor_ns.whole + ns.whole + std::llrint(s.anchor_ns.rest + ns.rest);
}

}  // namespace stepdriver::motion
