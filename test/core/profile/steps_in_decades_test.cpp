#include <gtest/gtest.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "point_to_point/acceleration_ramp_down.h"
#include "point_to_point/moving_target.h"
#include "point_to_point/planner.h"
#include "profile/errors.h"
#include "profile/profile_sum.h"
#include "profile/shaped_profile.h"
#include "profile/step_finder.h"
#include "support/random_motion.h"

// Speeds, accelerations, jerks, lengths, start speeds, shapers and matrices of all orders of
// magnitude that a configuration may have, and of its bounds. The judge adds up the plans itself,
// in more bits than the finder: each step is where the sum crosses its half-step line, no line is
// left out, and no two steps are closer than the top speed allows.

namespace stepdriver::motion {
namespace {

#if LDBL_MANT_DIG < 113 && defined(__SIZEOF_FLOAT128__)
__extension__ using Exact = __float128;
#else
using Exact = long double;
#endif

Exact exact(DoubleDouble value) { return Exact(value.hi) + Exact(value.lo); }
Exact sizeOf(Exact value) { return value < 0 ? -value : value; }

// ---- the judge's own curve

/// Where a curve is, and how far the curve of the finder may be from it: it has the pieces' jerks
/// as doubles.
struct Place {
  Exact position;
  Exact doubt;
};

/// The plans of an axis. Each takes over from the one before at its start.
class Plans {
 public:
  explicit Plans(std::int64_t rest) : rest_(rest) {}

  void add(std::shared_ptr<const Profile> profile) {
    Plan plan;
    plan.start_ns = profile->startNs();
    plan.end = exact(profile->endPosition());
    Exact start = 0;
    for (const Piece& piece : profile->pieces()) {
      plan.pieces.push_back({start, exact(piece.duration), exact(piece.p0),
                             Exact(piece.v0) + Exact(piece.v0_rest),
                             Exact(piece.a) + Exact(piece.a_rest), Exact(piece.j)});
      start += plan.pieces.back().duration;
    }
    plans_.push_back(std::move(plan));
  }

  struct State {
    Exact position;
    Exact jerk;
    Exact age;  // s since the jerk has been this one
  };
  /// @param ns motion time, with a fraction
  State at(Exact ns) const {
    const Plan* plan = nullptr;
    for (const Plan& next : plans_) {
      if (Exact(next.start_ns) <= ns) plan = &next;
    }
    if (plan == nullptr) return {Exact(rest_), 0, 0};
    const Exact time = (ns - Exact(plan->start_ns)) / Exact(1e9);
    for (const PlanPiece& piece : plan->pieces) {
      const Exact t = time - piece.start;
      if (t > piece.duration) continue;
      return {piece.p + t * (piece.v + t * (piece.a / 2 + t * piece.j / 6)), piece.j, t};
    }
    return {plan->end, 0, 0};
  }

 private:
  struct PlanPiece {
    Exact start, duration, p, v, a, j;
  };
  struct Plan {
    std::int64_t start_ns = 0;
    Exact end = 0;
    std::vector<PlanPiece> pieces;
  };
  std::int64_t rest_;
  std::vector<Plan> plans_;
};

/// One axis of those that share motors, with all its plans.
struct Axis {
  explicit Axis(std::int64_t rest) : at_rest(rest), plans(rest) {}

  std::int64_t at_rest;
  std::shared_ptr<const InputShaper> shaper;
  std::vector<PlannedMotion> motions;  // each takes over from the one before
  Plans plans;
  double top_speed = 0.0;
  // A plan may begin up to a billionth of a microstep from where the one before it was. What is
  // still to be made of that one may end on either side.
  Exact jumps = 0;
};

/// One motor, which all axes move.
class Motor {
 public:
  Motor(const std::vector<Axis>& axes, std::vector<double> factors)
      : axes_(axes), factors_(std::move(factors)) {}

  Place at(Exact ns) const {
    Place place{0, 0};
    Exact jerks = 0;
    Exact age = std::numeric_limits<double>::max();
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const auto add = [&](Exact factor, Exact time) {
        const Plans::State state = axes_[k].plans.at(time);
        place.position += factor * state.position;
        if (state.jerk == 0) return;
        jerks += sizeOf(factor * state.jerk);
        age = std::min(age, state.age);
      };
      if (axes_[k].shaper == nullptr) {
        add(factors_[k], ns);
      } else {
        for (const Impulse& impulse : axes_[k].shaper->impulses()) {
          add(Exact(factors_[k]) * Exact(impulse.part), ns - Exact(impulse.delay_ns));
        }
        place.doubt += sizeOf(factors_[k]) * axes_[k].jumps;
      }
    }
    // A double of 53 bits, in the factor, the jerk and their sum.
    if (jerks > 0) place.doubt += jerks * Exact(3 * DBL_EPSILON) * age * age * age / 6;
    // Lines are at halves, whose distance from the next whole number is a double, too.
    place.doubt += Exact(2 * DBL_EPSILON) + sizeOf(place.position) * Exact(1e-29);
    return place;
  }

  double topSpeed() const {
    double speed = 0.0;
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      speed += std::abs(factors_[k]) * axes_[k].top_speed;
    }
    return speed;
  }

  void begin(ProfileSum& sum, std::int64_t at_ns) const {
    sum.begin(at_ns);
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const PlannedMotion* motion = nullptr;
      for (const PlannedMotion& next : axes_[k].motions) {
        if (next.plan()->startNs() <= at_ns) motion = &next;
      }
      if (motion == nullptr) {
        sum.add(factors_[k], fromInteger(axes_[k].at_rest));
      } else {
        sum.add(factors_[k], motion->made());
      }
    }
  }

 private:
  const std::vector<Axis>& axes_;
  std::vector<double> factors_;
};

// ---- random machines and what they are told

constexpr double kHighestRate = 1e7;  // [steps/s] a pulse of 0.1 us

double decadesOrBound(Random& random, double low, double high) {
  if (random.chance(0.1)) return std::pow(10.0, low);
  if (random.chance(0.1)) return std::pow(10.0, high);
  return random.decades(low, high);
}

/// Within the bounds of the configuration's reader.
MotionLimits limitsOf(Random& random, bool shaped) {
  MotionLimits limits;
  limits.max_speed = decadesOrBound(random, -3.0, 7.0);
  if (random.chance(0.6)) {
    // As machines have them: the top speed is reached within a microsecond to a year.
    const auto within = [](double value, double highest) {
      return std::clamp(value, 1e-3, highest);
    };
    limits.acceleration = within(limits.max_speed * random.decades(-7.0, 6.0), 1e12);
    limits.deceleration = within(limits.acceleration * random.decades(-3.0, 3.0), 1e12);
    limits.jerk = within(limits.acceleration * random.decades(-7.0, 6.0), 1e15);
  } else {
    limits.acceleration = decadesOrBound(random, -3.0, 12.0);
    limits.deceleration = decadesOrBound(random, -3.0, 12.0);
    limits.jerk = decadesOrBound(random, -3.0, 15.0);
  }
  if (random.chance(0.3)) limits.deceleration = limits.acceleration;
  if (random.chance(0.4)) limits.jerk = 0.0;
  if (!shaped && random.chance(0.3)) {
    limits.start_speed = std::min(decadesOrBound(random, -9.0, 0.0), 1.0) * limits.max_speed;
  }
  return limits;
}

InputShaper oneShaper(Random& random) {
  const double frequency = std::clamp(decadesOrBound(random, -0.30103, 3.0), 0.5, 1000.0);
  const double damping = random.chance(0.6) ? 0.0 : random.within(0.0, 0.9);
  switch (random.whole(0, 3)) {
    case 0:
      return InputShaper::zv(frequency, damping);
    case 1:
      return InputShaper::mzv(frequency, damping);
    case 2:
      return InputShaper::ei(frequency, damping);
    default:
      return InputShaper::twoHumpEi(frequency, damping);
  }
}

std::shared_ptr<const InputShaper> shaperOf(Random& random) {
  InputShaper shaper = oneShaper(random);
  while (random.chance(0.5)) {
    const InputShaper other = oneShaper(random);
    if (shaper.impulses().size() * other.impulses().size() > InputShaper::kMostImpulses) break;
    shaper = shaper.with(other);
  }
  return std::make_shared<const InputShaper>(std::move(shaper));
}

std::vector<std::vector<double>> matrixOf(Random& random, std::size_t size) {
  if (size == 1) return {{1.0}};
  if (size == 2 && random.chance(0.3)) return {{1.0, 1.0}, {1.0, -1.0}};
  if (size == 2 && random.chance(0.3)) return {{0.7, 0.3}, {0.3, -0.7}};
  std::vector<std::vector<double>> matrix(size, std::vector<double>(size));
  for (auto& row : matrix) {
    const double scale = random.chance(0.5) ? 1.0 : random.decades(-6.0, 6.0);
    for (double& entry : row) entry = scale * random.within(-1.0, 1.0);
  }
  return matrix;
}

std::int64_t anyTarget(Random& random, const MotionState& state, const MotionLimits& limits,
                       double most) {
  const double v = std::max(std::abs(state.velocity), limits.max_speed);
  const double braking = std::min(v * v / limits.deceleration, most);
  const double way = random.chance(0.3) ? braking * random.within(-3.0, 3.0)
                                        : std::copysign(random.decades(-0.5, std::log10(most)),
                                                        random.within(-1.0, 1.0));
  return std::llround(state.position.hi + way);
}

void expectEnd(const MotionState& end, const MotionState& wanted, const MotionState& from,
               const MotionLimits& limits) {
  EXPECT_LE(std::abs((end.position - wanted.position).value()), 1e-9)
      << "misses its target from " << from << ", " << limits;
  // A ramp of 1e-15 s is no part of a motion.
  const double fastest = std::max(limits.max_speed, std::abs(from.velocity));
  const double steepest = std::max(limits.acceleration, limits.deceleration);
  EXPECT_LE(std::abs(end.velocity - wanted.velocity), 1e-12 * fastest + 1.1e-15 * steepest)
      << "from " << from << ", " << limits;
}

MotionState endOf(const Profile& profile) {
  std::vector<Piece> pieces;
  if (profile.pieceCount() > 0) pieces.push_back(profile.pieces().back());
  return motion::endOf(pieces, {profile.endPosition(), 0.0, 0.0});
}

Profile anyMove(Random& random, std::int64_t now, const MotionState& state,
                const MotionLimits& limits) {
  const std::int64_t target = anyTarget(random, state, limits, 1e12);
  const double most_jerk = random.chance(0.3) ? 0.0 : limits.jerk * random.decades(0.0, 6.0);
  const AccelerationRampDown ramp_down(now, state, limits, most_jerk);
  const Profile profile =
      ramp_down.followedBy(planMove(ramp_down.endNs(), ramp_down.end(), target, limits)).profile;
  MotionState end = endOf(profile);
  if (limits.start_speed > 0.0) end.velocity = 0.0;  // it stops from there at once
  expectEnd(end, {fromInteger(target), 0.0, 0.0}, state, limits);
  return profile;
}

/// Joins a moving point.
Profile anyIntercept(Random& random, std::int64_t now, const MotionState& state,
                     const MotionLimits& limits) {
  const MovingTarget point{
      fromInteger(anyTarget(random, state, limits, 1e6)),
      random.chance(0.3) ? 0.0 : limits.max_speed * random.within(-0.999, 0.999)};
  const double within = random.chance(0.5) ? 0.0 : random.decades(-3.0, 0.0);
  const std::vector<Piece> pieces = planIntercept(state, point, limits, within);
  if (pieces.empty()) return {now, state.position};
  Profile profile(now, pieces);
  expectEnd(motion::endOf(pieces, state),
            {point.position + profile.duration() * point.velocity, point.velocity, 0.0}, state,
            limits);
  return profile;
}

/// The profile of any command.
Profile anyCommand(Random& random, std::int64_t now, const MotionState& state,
                   const MotionLimits& limits) {
  const double which = random.within(0.0, 1.0);
  if (which < 0.1) return planStop(now, state, limits);
  if (which < 0.2) {
    const double velocity = std::copysign(
        std::max(1e-3, limits.max_speed * random.decades(-9.0, 0.0)), random.within(-1.0, 1.0));
    return planVelocity(now, state, velocity, limits).profile;
  }
  return which < 0.3 ? anyIntercept(random, now, state, limits)
                     : anyMove(random, now, state, limits);
}

constexpr double kNsPerS = 1e9;

/// Some moment of the last motion of an axis: anywhere in it, near its beginning or a break.
std::int64_t someMoment(Random& random, const Axis& axis) {
  const Profile& plan = *axis.motions.back().plan();
  const std::int64_t end = plan.endNs() + (axis.shaper != nullptr ? axis.shaper->durationNs() : 0);
  const auto length = static_cast<double>(end - plan.startNs());
  double after = length * random.within(0.0, 1.0);
  if (random.chance(0.3)) after = std::min(length, random.decades(0.0, 18.0));
  if (random.chance(0.3) && plan.pieceCount() > 0) {
    const auto piece =
        static_cast<std::size_t>(random.whole(0, static_cast<std::int64_t>(plan.pieceCount())));
    after = plan.pieceStart(piece).value() * kNsPerS + random.within(-3.0, 3.0);
    if (axis.shaper != nullptr && random.chance(0.5)) {
      after += static_cast<double>(axis.shaper->durationNs()) * random.within(0.0, 1.0);
    }
  }
  return plan.startNs() + std::llround(std::clamp(after, 0.0, length));
}

// Positions beyond 2^53 are refused before anything is planned.
constexpr double kFarthest = 9e15;

// A motion of 126 years may be followed by another one, but not by three.
constexpr std::int64_t kLatest = 5'000'000'000'000'000'000;  // ns

/// Tells the axis something. @return whether that is possible
bool command(Random& random, Axis& axis, std::int64_t now, const MotionLimits& limits) {
  MotionState state{fromInteger(axis.at_rest), 0.0, 0.0};
  if (!axis.motions.empty()) state = axis.motions.back().plan()->stateAt(now);
  try {
    auto plan = std::make_shared<const Profile>(anyCommand(random, now, state, limits));
    if (plan->endNs() > kLatest) return false;
    if (!(std::abs(plan->endPosition().hi) < kFarthest)) return false;
    double top = std::max(limits.max_speed, std::abs(state.velocity));
    if (limits.jerk > 0.0) {
      const double a = state.acceleration;
      top = std::max(top, std::abs(state.velocity + a * std::abs(a) / (2.0 * limits.jerk)));
    }
    axis.top_speed = std::max(axis.top_speed, top);
    axis.jumps += sizeOf(exact(plan->startPosition() - state.position));
    axis.plans.add(plan);
    axis.motions.push_back(axis.motions.empty() ? PlannedMotion(plan, axis.shaper)
                                                : axis.motions.back().takenOverBy(plan));
    return true;
  } catch (const TooLong&) {
    return false;  // it takes more than a hundred years
  }
}

// ---- the judge

/// Follows a motor from a time on, for some steps or until a time.
class Judge {
 public:
  Judge(const Motor& motor, std::int64_t from_ns, std::int64_t count)
      : motor_(motor), from_ns_(from_ns), count_(count) {}

  std::int64_t count() const { return count_; }

  /// Follows the sum of all axes, as the engine does when a profile begins, is replaced or ends.
  /// @param until_ns when the engine begins another sum
  /// @param most steps
  /// @return the number of steps
  int follow(std::int64_t until_ns, int most) {
    ProfileSum sum;
    motor_.begin(sum, from_ns_);
    return follow(StepFinder(sum, count_), until_ns, most);
  }

  int follow(StepFinder finder, std::int64_t until_ns, int most) {
    std::int64_t time = from_ns_;
    int direction = 0;
    int steps = 0;
    for (Step step; steps < most; ++steps) {
      const bool found = finder.next(step);
      if (!found || step.time_ns >= until_ns) {
        expectAt(Exact(until_ns));
        break;
      }
      expectAt((Exact(time) + Exact(step.time_ns)) / 2);
      expectCrossing(step);
      if (step.direction == direction) expectApart(step.time_ns - time);
      time = step.time_ns;
      direction = step.direction;
      count_ += direction;
      EXPECT_EQ(finder.count(), count_);
      if (testing::Test::HasFailure()) break;
    }
    return steps;
  }

 private:
  // Steps lie on whole nanoseconds, at most half a one from the line. The other half is for the
  // arithmetic in doubles of a stretch, which is 1/8 ns in 78 hours.
  static constexpr int kOff = 1;  // ns

  void expectCrossing(const Step& step) const {
    const Exact line = Exact(count_) + Exact(0.5 * step.direction);
    const Place before = motor_.at(Exact(step.time_ns - kOff));
    const Place after = motor_.at(Exact(step.time_ns + kOff));
    const Exact early = Exact(step.direction) * (after.position - line) + after.doubt;
    const Exact late = Exact(step.direction) * (line - before.position) + before.doubt;
    EXPECT_GE(static_cast<double>(early), 0.0) << "too early: " << textOf(step);
    EXPECT_GE(static_cast<double>(late), 0.0) << "too late: " << textOf(step);
  }

  // Between two steps the curve is between two lines.
  void expectAt(Exact ns) const {
    const Place place = motor_.at(ns);
    // If it turns on a line, a nanosecond is as good as no time.
    const Exact off = sizeOf(place.position - Exact(count_)) - place.doubt;
    if (off <= Exact(0.5)) return;
    const Exact before = sizeOf(motor_.at(ns - Exact(kOff)).position - Exact(count_));
    const Exact after = sizeOf(motor_.at(ns + Exact(kOff)).position - Exact(count_));
    EXPECT_LE(static_cast<double>(std::min(before, after)), 0.5 + static_cast<double>(place.doubt))
        << "misses a step: count " << count_ << " at " << static_cast<double>(ns)
        << " ns, position off by " << static_cast<double>(off);
  }

  void expectApart(std::int64_t interval) const {
    const double doubt = 1.0 + 1e-9;  // ns: half a one at either end
    EXPECT_GE(static_cast<double>(interval), kNsPerS / motor_.topSpeed() * (1.0 - 1e-9) - doubt)
        << "closer than at " << motor_.topSpeed() << " steps/s";
  }

  testing::Message textOf(const Step& step) const {
    return testing::Message() << "step from " << count_ << " by " << step.direction << " at "
                              << step.time_ns << " ns";
  }

  const Motor& motor_;
  std::int64_t from_ns_;
  std::int64_t count_;
};

struct Machine {
  std::vector<Axis> axes;
  std::vector<std::vector<double>> matrix;
  std::vector<std::int64_t> changes;  // motion times of commands
};

/// @return nothing if it would take too long
std::unique_ptr<Machine> anyMachine(Random& random) {
  auto machine = std::make_unique<Machine>();
  const auto size = static_cast<std::size_t>(random.chance(0.5) ? 1 : random.whole(2, 4));
  std::vector<MotionLimits> limits;
  for (std::size_t k = 0; k < size; ++k) {
    Axis axis(random.chance(0.5) ? 0 : random.whole(-1'000'000'000'000, 1'000'000'000'000));
    if (random.chance(0.5)) axis.shaper = shaperOf(random);
    limits.push_back(limitsOf(random, axis.shaper != nullptr));
    machine->axes.push_back(std::move(axis));
  }
  std::int64_t now = random.chance(0.5) ? 0 : random.whole(0, std::int64_t{1} << 56);
  const std::int64_t commands = random.whole(1, 5);
  for (std::int64_t i = 0; i < commands; ++i) {
    const auto which =
        i == 0 ? 0 : static_cast<std::size_t>(random.whole(0, static_cast<std::int64_t>(size) - 1));
    if (i > 0) now = std::max(now + 1, someMoment(random, machine->axes[0]));
    if (random.chance(0.3))
      limits[which] = limitsOf(random, machine->axes[which].shaper != nullptr);
    if (!command(random, machine->axes[which], now, limits[which])) {
      if (machine->axes[0].motions.empty()) return nullptr;
      break;
    }
    machine->changes.push_back(now);
  }
  machine->matrix = matrixOf(random, size);
  for (std::vector<double>& row : machine->matrix) {
    const double rate = Motor(machine->axes, row).topSpeed();
    if (rate <= kHighestRate) continue;
    for (double& factor : row) factor *= kHighestRate / rate;
  }
  return machine;
}

/// When another plan begins, or all have ended.
std::int64_t nextChange(const Machine& machine, std::int64_t from) {
  std::int64_t until = 0;
  for (const Axis& axis : machine.axes) {
    if (axis.motions.empty()) continue;
    until = std::max(until, axis.motions.back().made().endNs() + 1);
  }
  for (const std::int64_t change : machine.changes) {
    if (change > from) until = std::min(until, change);
  }
  return until;
}

/// The count nearest to the motor's place; empty if that is on a line, where two are right.
std::optional<std::int64_t> countAt(const Motor& motor, std::int64_t from) {
  const Place place = motor.at(Exact(from));
  const std::int64_t count =
      split(DoubleDouble(static_cast<double>(place.position)) +
            static_cast<double>(place.position - Exact(static_cast<double>(place.position))))
          .whole;
  if (sizeOf(place.position) > Exact(kFarthest)) return std::nullopt;
  const Exact rest = sizeOf(place.position - Exact(count));  // at most a half
  if (sizeOf(rest - Exact(0.5)) < Exact(1e-6)) return std::nullopt;
  return count;
}

/// Looks at a motor from a time on until the next change.
int look(const Machine& machine, const Motor& motor, std::int64_t from, int most) {
  const std::int64_t until = nextChange(machine, from);
  const auto count = countAt(motor, from);
  if (!count || from >= until) return 0;
  return Judge(motor, from, *count).follow(until, most);
}

/// Follows a motor through all its plans, as the engine does, if it has few steps to make.
int followAll(const Machine& machine, const Motor& motor) {
  constexpr int kFew = 500;
  std::int64_t from = machine.changes.front();
  auto count = countAt(motor, from);
  int steps = 0;
  while (count) {
    const std::int64_t until = nextChange(machine, from);
    if (from >= until) break;
    Judge judge(motor, from, *count);
    const int here = judge.follow(until, kFew);
    steps += here;
    if (here == kFew || testing::Test::HasFailure()) break;
    count = judge.count();
    from = until;
  }
  return steps;
}

/// The steps of one axis that isn't shaped, from its profiles themselves.
int lookAtProfiles(const Machine& machine, const Motor& motor, int most) {
  const Axis& axis = machine.axes.front();
  if (machine.matrix != std::vector<std::vector<double>>{{1.0}} || axis.shaper != nullptr) return 0;
  int steps = 0;
  for (const PlannedMotion& motion : axis.motions) {
    const Profile& plan = *motion.plan();
    const auto count = countAt(motor, plan.startNs());
    if (!count) continue;
    Judge judge(motor, plan.startNs(), *count);
    steps += judge.follow(StepFinder(plan, *count), nextChange(machine, plan.startNs()), most);
  }
  return steps;
}

TEST(StepsInDecades, LieWhereTheSumOfAllPartsCrossesTheirLines) {
  constexpr int kMachines = 400;
  constexpr int kMost = 40;  // steps of a look
  Random random(33);
  std::int64_t steps = 0;
  int moved = 0;
  for (int i = 0; i < kMachines; ++i) {
    SCOPED_TRACE(testing::Message() << "machine " << i);
    const auto machine = anyMachine(random);
    if (HasFailure()) return;
    if (machine == nullptr) continue;
    int here = 0;
    for (const std::vector<double>& row : machine->matrix) {
      const Motor motor(machine->axes, row);
      here += followAll(*machine, motor) + lookAtProfiles(*machine, motor, kMost);
      if (HasFailure()) return;
      for (const std::int64_t change : machine->changes) {
        here += look(*machine, motor, change, kMost);
        if (HasFailure()) return;
      }
      for (int k = 0; k < 4; ++k) {
        for (const Axis& axis : machine->axes) {
          if (axis.motions.empty()) continue;
          here += look(*machine, motor, someMoment(random, axis), kMost);
          if (HasFailure()) return;
        }
      }
    }
    steps += here;
    moved += here > 0 ? 1 : 0;
  }
  EXPECT_GT(moved, kMachines / 2);
  EXPECT_GT(steps, 25 * kMachines);
}

}  // namespace
}  // namespace stepdriver::motion
