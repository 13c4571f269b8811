#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "point_to_point/planner.h"
#include "support/random_motion.h"

namespace stepdriver::motion {
namespace {

// All motions whose jerk is -J, 0 or J over whole seconds, with J = 6 microsteps/s^3, run on a
// lattice of whole numbers: a = 6 i, v = 3 n, p = m. A breadth-first search backwards from rest at
// 0 gives, for each state of the lattice, the least number of seconds in which such a motion comes
// to rest at 0. The fastest of all motions may be faster than that, but not by much.
struct LatticeState {
  int a = 0;
  int v = 0;
  int p = 0;
};

class Lattice {
 public:
  static constexpr int kNever = 0x7fff;

  // Highest a and v in lattice units. If `below`, the position must not exceed 0.
  Lattice(int acceleration, int deceleration, int speed, bool below)
      : acceleration_(acceleration),
        deceleration_(deceleration),
        speed_(speed),
        highest_(below ? 0 : kLowest / -2),
        widest_(std::max(acceleration, deceleration)) {
    const int size = (2 * widest_ + 1) * (2 * speed_ + 1) * (highest_ - kLowest + 1);
    seconds_.assign(static_cast<std::size_t>(size), kNever);
    search();
  }

  static constexpr int kLowest = -1200;

  int secondsFrom(const LatticeState& state) const { return seconds_[indexOf(state)]; }

  MotionLimits limits() const {
    return {0.0, 3.0 * speed_, 6.0 * acceleration_, 6.0 * deceleration_, 6.0};
  }

  template <typename Visitor>
  void forEach(int stride, const Visitor& visit) const {
    int skip = 0;
    for (int a = -widest_; a <= widest_; ++a) {
      for (int v = -speed_; v <= speed_; ++v) {
        for (int p = kLowest / 2; p < 0; ++p) {
          if (!allowed({a, v, p}) || !onLattice({a, v, p})) continue;
          if (++skip % stride == 0) visit(LatticeState{a, v, p});
        }
      }
    }
  }

 private:
  // Rest at 0 has these properties, and no second of jerk -1, 0 or 1 changes them: v - a is even,
  // and p - a is a multiple of 6.
  static bool onLattice(const LatticeState& s) {
    return (s.v - s.a) % 2 == 0 && (s.p - s.a) % 6 == 0;
  }

  bool allowed(const LatticeState& s) const {
    if (std::abs(s.v) > speed_ || s.p < kLowest || s.p > highest_) return false;
    const int up = s.v < 0 ? deceleration_ : acceleration_;
    const int down = s.v > 0 ? deceleration_ : acceleration_;
    const int least = std::min(acceleration_, deceleration_);
    return s.v == 0 ? std::abs(s.a) <= least : s.a <= up && s.a >= -down;
  }

  std::size_t indexOf(const LatticeState& s) const {
    const int row = (s.a + widest_) * (2 * speed_ + 1) + s.v + speed_;
    return static_cast<std::size_t>(row * (highest_ - kLowest + 1) + s.p - kLowest);
  }

  // A second in which the motion turns must keep the limits of both directions, and must not turn
  // above the highest position.
  bool allowedBetween(const LatticeState& from, const LatticeState& to, int j) const {
    if (from.v * to.v >= 0) return true;
    const int least = std::min(acceleration_, deceleration_);
    if (std::abs(from.a) > least || std::abs(to.a) > least) return false;
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < 40; ++i) {
      const double t = (low + high) / 2.0;
      const double v = from.v + t * (2.0 * from.a + t * j);
      (v * from.v > 0.0 ? low : high) = t;
    }
    return from.p + low * (3.0 * from.v + low * (3.0 * from.a + low * j)) <= highest_ + 1e-9;
  }

  void search() {
    std::vector<LatticeState> now{{0, 0, 0}};
    seconds_[indexOf(now.front())] = 0;
    for (std::int16_t second = 1; !now.empty(); ++second) {
      std::vector<LatticeState> before;
      for (const LatticeState& to : now) {
        for (int j = -1; j <= 1; ++j) {
          LatticeState from;
          from.a = to.a - j;
          from.v = to.v - 2 * from.a - j;
          from.p = to.p - 3 * from.v - 3 * from.a - j;
          if (!allowed(from) || std::abs(from.a) > widest_) continue;
          if (seconds_[indexOf(from)] != kNever || !allowedBetween(from, to, j)) continue;
          seconds_[indexOf(from)] = second;
          before.push_back(from);
        }
      }
      now = std::move(before);
    }
  }

  int acceleration_;
  int deceleration_;
  int speed_;
  int highest_;
  int widest_;
  std::vector<std::int16_t> seconds_;
};

// The same for changes of velocity to `goal`, whatever the final position.
class VelocityLattice {
 public:
  VelocityLattice(int acceleration, int deceleration, int goal)
      : acceleration_(acceleration), deceleration_(deceleration) {
    std::vector<std::pair<int, int>> now{{0, goal}};
    for (int second = 0; !now.empty(); ++second) {
      std::vector<std::pair<int, int>> before;
      for (const auto& [a, v] : now) {
        if (!allowed(a, v) || !seconds_.emplace(std::pair{a, v}, second).second) continue;
        for (int j = -1; j <= 1; ++j) {
          const int from = v - 2 * (a - j) - j;
          const int widest = std::max(std::abs(a), std::abs(a - j));
          if (from * v < 0 && widest > std::min(acceleration, deceleration)) continue;
          before.emplace_back(a - j, from);
        }
      }
      now = std::move(before);
    }
  }

  template <typename Visitor>
  void forEach(const Visitor& visit) const {
    for (const auto& [state, seconds] : seconds_) visit(state.first, state.second, seconds);
  }

 private:
  bool allowed(int a, int v) const {
    const int up = v < 0 ? deceleration_ : acceleration_;
    const int down = v > 0 ? deceleration_ : acceleration_;
    if (v == 0) return std::abs(a) <= std::min(acceleration_, deceleration_);
    return std::abs(v) <= 80 && a <= up && a >= -down;
  }

  int acceleration_;
  int deceleration_;
  std::map<std::pair<int, int>, int> seconds_;
};

class PlannerLattice : public testing::TestWithParam<std::array<int, 3>> {};

TEST_P(PlannerLattice, NoMotionOnALatticeIsFasterOrAvoidsAnOvershoot) {
  const auto [acceleration, deceleration, speed] = GetParam();
  const Lattice below(acceleration, deceleration, speed, true);
  const Lattice free(acceleration, deceleration, speed, false);
  int direct = 0;
  int overshoots = 0;
  double faster = 0.0;  // s, in all
  below.forEach(3, [&](const LatticeState& s) {
    const MotionState from{DoubleDouble(s.p), 3.0 * s.v, 6.0 * s.a};
    const Plan plan = planMove(0, from, 0, below.limits());
    const double time = plan.profile.duration().value();
    const int other = (plan.overshoots() ? free : below).secondsFrom(s);
    SCOPED_TRACE(testing::Message() << "a " << s.a << ", v " << s.v << ", p " << s.p << ": " << time
                                    << " s, on the lattice " << other);
    if (plan.overshoots()) {
      EXPECT_EQ(below.secondsFrom(s), Lattice::kNever) << "the target need not be passed";
    }
    EXPECT_LE(time, other + 1e-9);
    if (other == Lattice::kNever) return;
    faster += other - time;
    ++(plan.overshoots() ? overshoots : direct);
  });
  EXPECT_GT(direct, 4000);
  EXPECT_GT(overshoots, 500);
  // What the restriction to whole seconds costs, of some 14 s: with a lattice twice as fine it is
  // half.
  EXPECT_LT(faster / (direct + overshoots), 1.1);
}

INSTANTIATE_TEST_SUITE_P(Limits, PlannerLattice,
                         testing::Values(std::array{3, 3, 24}, std::array{2, 4, 30},
                                         std::array{4, 2, 24}, std::array{5, 5, 20}));

TEST_P(PlannerLattice, NoChangeOfVelocityOnALatticeIsFaster) {
  const auto [acceleration, deceleration, speed] = GetParam();
  for (const int goal : {1, 4, speed / 2, speed}) {
    const VelocityLattice lattice(acceleration, deceleration, goal);
    const MotionLimits limits{0.0, 3.0 * speed, 6.0 * acceleration, 6.0 * deceleration, 6.0};
    double faster = 0.0;
    int changes = 0;
    lattice.forEach([&](int a, int v, int seconds) {
      const Profile change =
          planVelocity(0, {DoubleDouble(0.0), 3.0 * v, 6.0 * a}, 3.0 * goal, limits).profile;
      const double time = change.pieceStart(change.pieces().size() - 1).value();
      EXPECT_LE(time, seconds + 1e-9) << "a " << a << ", v " << v << " to " << goal;
      faster += seconds - time;
      ++changes;
    });
    EXPECT_GT(changes, 100);
    EXPECT_LT(faster / changes, 1.0);
  }
}

// Without a jerk limit: brake if the distance is too short or leads away, then a trapezoid from the
// remaining speed.
long double trapezoidTime(long double way, long double v, const MotionLimits& limits) {
  const long double a = limits.acceleration;
  const long double d = limits.deceleration;
  const long double stop = v * std::abs(v) / (2.0L * d);
  if (way < stop) return trapezoidTime(-way, -v, limits);
  if (v < 0.0L) return -v / d + trapezoidTime(way - stop, 0.0L, limits);
  const long double highest = std::sqrt((2.0L * way + v * v / a) / (1.0L / a + 1.0L / d));
  const long double peak = std::min<long double>(limits.max_speed, highest);
  const long double change = peak > v ? a : -d;
  const long double ramps = (peak * peak - v * v) / (2.0L * change) + peak * peak / (2.0L * d);
  return (peak - v) / change + (way - ramps) / peak + peak / d;
}

TEST(PlannerOptimum, WithoutAJerkLimitIsTheClosedForm) {
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    MotionLimits limits = anyLimits(random);
    limits.jerk = 0.0;
    limits.start_speed = 0.0;
    const MotionState from = anyState(random, limits);
    const std::int64_t target = anyTarget(random, from, limits);
    SCOPED_TRACE(testing::Message() << from << " to " << target << ", " << limits);
    const long double way = target - static_cast<long double>(from.position.hi) - from.position.lo;
    const auto time = static_cast<double>(trapezoidTime(way, from.velocity, limits));
    const double planned = planMove(0, from, target, limits).profile.duration().value();
    EXPECT_NEAR(planned, time, 1e-9 + 1e-12 * time);
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::motion
