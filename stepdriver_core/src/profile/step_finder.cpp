#include "step_finder.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {
namespace {

// From this time on, the error of a double with 53 bits exceeds 1/32 ns.
constexpr double kFar = 281474.976710656;  // [s] 2^48 ns, 78 hours

// Up to this time, the rounding of a stretch's reciprocals causes an error below 1/64 ns.
constexpr double kShort = 20000.0;  // [s]

// Whether a ramp takes less than this from standstill to its fast end, and makes a microstep within
// it. A residual of a sum is no such ramp.
bool isShortRamp(double acceleration, double fastest) {
  return fastest < kShort * acceleration && acceleration * (kShort * kShort) > 1.0;
}

// Nearest integer of a number below 2^51: the sum has no bits left for a fraction. (llrint() is a
// call into the library.)
std::int64_t nearest(double number) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52
  return static_cast<std::int64_t>((number + kShift) - kShift);
}

// The first turning point or extreme of the speed after the time `after`; the end if there is none.
double firstCut(const Piece& piece, double after) {
  const double turn = piece.firstTurn(after);
  if (piece.j == 0.0) return turn;
  const double level = -piece.a / piece.j;
  // Next to an end, the speed changes by less than a double's rounding from there to its extreme:
  // a part of its own would cost more than it is worth.
  const double margin = 1e-9 * piece.duration.value();
  return level > after + margin && level < turn - margin ? level : turn;
}

}  // namespace

StepFinder::StepFinder(const Profile& profile, std::int64_t count)
    : profile_(&profile), start_ns_(profile.startNs()) {
  stretch_.anchor_count = count;
}

StepFinder::StepFinder(ProfileSum& sum, std::int64_t count) : sum_(&sum), start_ns_(sum.startNs()) {
  stretch_.anchor_count = count;
}

// Inline, because every step uses these two.
inline double StepFinder::cubicTime(double way) {
  constexpr double kNear = 1e-13;  // [s]
  Stretch& s = stretch_;
  // This order shortens the chain of operations that wait for the last step.
  const double before = 4.0 * s.last[2] - 6.0 * s.last[1] - s.last[3];
  double t = before + 4.0 * s.last[0];
  const double bend = t * s.j;
  const double v = s.v + t * (s.a + bend * 0.5);
  const double error = (way - t * s.v) - (t * t) * (s.a * 0.5 + bend * (1.0 / 6.0));
  const double correction = error / v;
  const double a = std::abs(s.a) + std::abs(bend);
  const bool inside = s.known >= 4 && t > 0.0 && t < s.duration;
  if (inside && a * correction * correction < kNear * v) {
    t += correction;
  } else {
    t = bracketedTime(way);
    ++s.known;
  }
  s.last = {t, s.last[0], s.last[1], s.last[2]};
  return t;
}

inline double StepFinder::timeFromAnchor(double way) {
  const Stretch& s = stretch_;
  switch (s.curve) {
    case Stretch::Curve::kLine:
      return way / s.v;
    case Stretch::Curve::kParabola:
      return 2.0 * way / (s.v + std::sqrt(s.v_squared + s.twice_a * way));
    default:
      return cubicTime(way);
  }
}

inline bool StepFinder::give(Step& step, std::int64_t time_ns) {
  Stretch& s = stretch_;
  s.way += s.way_step;
  step.time_ns = std::min(std::max(time_ns, s.begin_ns), s.end_ns);
  step.direction = s.direction;
  return true;
}

bool StepFinder::next(Step& step) {
  const Stretch& s = stretch_;
  if (s.way == s.way_end) return nextOfNewStretch(step);
  const double way = std::max(static_cast<double>(s.way) + s.way_rest, 0.0);
  double ns = 0.0;
  if (s.curve == Stretch::Curve::kShortLine) {
    ns = way * s.ns_per_unit;
  } else if (s.curve == Stretch::Curve::kShortParabola) {
    ns = (std::sqrt(s.v_squared + s.twice_a * way) - s.v) * s.ns_per_unit;
  } else {
    return nextOfOther(step, way);
  }
  return give(step, s.anchor_ns.whole + nearest(s.anchor_ns.rest + ns));
}

bool StepFinder::nextTo(std::int64_t low, std::int64_t high, Step& step) {
  for (;;) {
    Stretch& s = stretch_;
    const std::int64_t left = (s.way_end - s.way) * s.way_step;
    const std::int64_t wanted = s.direction > 0 ? high - count() : count() - low;
    if (wanted <= left) {
      s.way += (wanted - 1) * s.way_step;
      s.known = 0;  // the cubic needs the four steps right before this one
      return next(step);
    }
    s.way = s.way_end;
    if (!enterNext()) return false;
  }
}

bool StepFinder::nextOfNewStretch(Step& step) {
  while (stretch_.way == stretch_.way_end) {
    if (!enterNext()) return false;
  }
  return next(step);
}

bool StepFinder::nextOfOther(Step& step, double way) {
  const Stretch& s = stretch_;
  const double t = way > 0.0 ? timeFromAnchor(way) : 0.0;
  return give(
      step, t < kFar ? s.anchor_ns.whole + nearest(s.anchor_ns.rest + t * s.ns_per_s) : refined(t));
}

bool StepFinder::enterNext() {
  if (sum_ != nullptr) return enterNextOfSum();
  if (profile_ == nullptr || piece_ >= profile_->pieceCount()) return false;
  const Piece piece = profile_->piece(piece_);
  const double cut = firstCut(piece, done_);
  const bool last = !(cut < piece.duration.value());
  enter(piece, done_, last ? piece.duration : DoubleDouble(cut), profile_->pieceStart(piece_));
  done_ = last ? 0.0 : cut;
  if (last) ++piece_;
  return true;
}

bool StepFinder::enterNextOfSum() {
  if (done_ == 0.0 && !sum_->next()) return false;
  const Piece& piece = sum_->piece();
  const double cut = firstCut(piece, done_);
  const bool last = !(cut < piece.duration.value());
  enter(piece, done_, last ? piece.duration : DoubleDouble(cut), sum_->pieceStart());
  done_ = last ? 0.0 : cut;
  return true;
}

void StepFinder::enter(const Piece& piece, DoubleDouble begin, DoubleDouble end,
                       DoubleDouble piece_start) {
  const DoubleDouble from = piece.positionAt(begin);
  const DoubleDouble to = piece.positionAt(end);
  const double travel = (to - from).hi;
  if (travel == 0.0) return;
  const double direction = travel > 0.0 ? 1.0 : -1.0;

  // The last line that is crossed, not just touched: the largest k - 1/2 below `to` going up.
  const Split goal = split(to);
  const std::int64_t reached =
      direction > 0.0 ? goal.whole + static_cast<std::int64_t>(std::ceil(goal.rest - 0.5))
                      : goal.whole + static_cast<std::int64_t>(std::floor(goal.rest + 0.5));
  const std::int64_t stands = count();
  const std::int64_t steps = direction > 0.0 ? reached - stands : stands - reached;
  if (steps <= 0) return;

  // Next to a turning point, the speed of the slow end may be below 0 by a residual: it belongs to
  // the curve, so it stays. A curve whose fast end has none moves only by rounding.
  const DoubleDouble exact_begin = piece.velocityAt(begin);
  const DoubleDouble exact_end = piece.velocityAt(end);
  const double v_begin = direction * exact_begin.value();
  const double v_end = direction * exact_end.value();
  const double fastest = std::max(v_begin, v_end);
  if (!(fastest > 0.0)) return;
  const bool backwards = v_end < v_begin;
  const DoubleDouble anchor = backwards ? end : begin;

  stretch_.direction = direction > 0.0 ? 1 : -1;
  stretch_.time_sign = backwards ? -1.0 : 1.0;
  stretch_.ns_per_s = 1e9 * stretch_.time_sign;
  const auto motion_time = [&](DoubleDouble after) {
    const Split ns = splitNanoseconds(piece_start + after);
    return Split{start_ns_ + ns.whole, ns.rest};
  };
  stretch_.anchor_ns = motion_time(anchor);
  const Split anchor_position = backwards ? goal : split(from);
  stretch_.anchor_count = anchor_position.whole;
  stretch_.away = backwards ? -stretch_.direction : stretch_.direction;
  stretch_.way = stretch_.away * (stands - anchor_position.whole);
  stretch_.way_step = backwards ? -1 : 1;
  stretch_.way_end = stretch_.way + steps * stretch_.way_step;
  const auto away = static_cast<double>(stretch_.away);
  stretch_.way_rest = away * (direction * 0.5 - anchor_position.rest);
  stretch_.exact_v = DoubleDouble(direction) * (backwards ? exact_end : exact_begin);
  stretch_.exact_a = DoubleDouble(away) * piece.accelerationAt(anchor);
  stretch_.v = stretch_.exact_v.value();
  stretch_.v_squared = stretch_.v * stretch_.v;
  stretch_.a = stretch_.exact_a.value();
  stretch_.twice_a = 2.0 * stretch_.a;
  stretch_.j = direction * piece.j;
  stretch_.duration = (end - begin).value();
  chooseCurve(v_begin == v_end, fastest);
  stretch_.last[0] = backwards ? stretch_.duration : 0.0;
  stretch_.known = 0;
  stretch_.begin_ns = motion_time(begin).whole;
  stretch_.end_ns = motion_time(end).whole;
}

// If the speed is the same at both ends, it is the same between them: an acceleration or a jerk
// that doesn't change it is a residual of a sum, whose sign means nothing. Otherwise the
// acceleration of a parabola is above 0, because the slow end is the anchor.
void StepFinder::chooseCurve(bool constant_speed, double fastest) {
  using Curve = Stretch::Curve;
  Stretch& s = stretch_;
  if (constant_speed) {
    // A microstep takes less time than kShort, too.
    const bool is_short = s.duration < kShort && s.v * kShort > 1.0;
    s.curve = is_short ? Curve::kShortLine : Curve::kLine;
    s.ns_per_unit = s.ns_per_s / s.v;
  } else if (s.j != 0.0) {
    s.curve = Curve::kCubic;
  } else {
    s.curve = isShortRamp(s.a, fastest) ? Curve::kShortParabola : Curve::kParabola;
    s.ns_per_unit = s.ns_per_s / s.a;
  }
}

double StepFinder::bracketedTime(double way) const {
  const Stretch& s = stretch_;
  double low = s.time_sign > 0.0 ? s.last[0] : 0.0;
  double high = s.time_sign > 0.0 ? s.duration : s.last[0];
  const auto way_at = [&s](double t) { return t * (s.v + t * (s.a / 2.0 + t * (s.j / 6.0))); };
  const auto speed_at = [&s](double t) { return s.v + t * (s.a + t * (s.j / 2.0)); };

  double t = s.last[0];
  double speed = speed_at(t);
  // 100 halvings reach the last bit even if each step of Newton's method leaves the bracket.
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

std::int64_t StepFinder::refined(double rough) const {
  const Stretch& s = stretch_;
  const double t = std::min(rough, s.duration);
  const Piece seen{s.duration, 0.0, s.exact_v.hi, s.exact_a.hi, s.j, s.exact_v.lo, s.exact_a.lo};
  const DoubleDouble way = fromInteger(s.way) + DoubleDouble(s.way_rest);
  const double correction =
      (way - seen.positionAt(DoubleDouble(t))).value() / seen.velocityAt(DoubleDouble(t)).value();
  DoubleDouble exact = DoubleDouble(t) + DoubleDouble(correction);
  // At a residual speed, rounding may put a line before or after the stretch, by any time.
  if (!(exact.hi > 0.0)) exact = 0.0;
  if (exact.hi > s.duration) exact = s.duration;
  const Split ns = splitNanoseconds(DoubleDouble(s.time_sign) * exact);
  return s.anchor_ns.whole + ns.whole + std::llrint(s.anchor_ns.rest + ns.rest);
}

}  // namespace stepdriver::motion
