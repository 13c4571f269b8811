#include "jerk_limited_feed_deceleration.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "feed_rate.h"
#include "math/double_double.h"

namespace stepdriver::motion {
namespace {

// The jerks to try, the steepest fall first, as parts of the jerk of the rate that a motor would
// allow if nothing else moved it.
constexpr std::array<double, 10> kJerks = {-1.0,  -0.6, -0.35, -0.2, -0.1,
                                           -0.05, 0.0,  0.1,   0.3,  0.9};
constexpr std::array<double, 3> kEnds = {0.9, 0.5, 0.25};  // the parts to try when a slope is ended
constexpr double kNoSlope = 1e-9;                          // [1/s]
constexpr int kMostWithoutGain = 4;                        // slices

// The position on the path, its rate, and the slope of the rate [1/s].
struct RateState {
  DoubleDouble place;
  DoubleDouble rate;
  double slope = 0.0;

  Piece piece(DoubleDouble duration, double jerk) const {
    return {duration, place, rate.hi, slope, jerk, rate.lo};
  }
};

RateState endOf(const Piece& piece) {
  return {piece.positionAt(piece.duration), piece.velocityAt(piece.duration),
          piece.accelerationAt(piece.duration).value()};
}

class JerkLimitedFeedDeceleration {
 public:
  JerkLimitedFeedDeceleration(double target, const std::vector<LimitedCurve>& curves, double slice,
                              DoubleDouble end)
      : courses_(curves), target_(target), slice_(slice), end_(end) {}

  std::optional<std::vector<Piece>> plan(RateState state, double most) {
    std::vector<Piece> pieces;
    std::optional<std::vector<Piece>> best;
    int without_gain = 0;
    double time = 0.0;
    while (time < most && without_gain < kMostWithoutGain) {
      if (const std::optional<Piece> last = levelAtTarget(state, most - time)) {
        most = time + last->duration.value();
        best = pieces;
        best->push_back(*last);
        without_gain = 0;
      } else if (best) {
        ++without_gain;
      }
      const std::optional<Piece> next = steepest(state);
      if (!next) break;
      pieces.push_back(*next);
      time += next->duration.value();
      state = endOf(*next);
    }
    return best;
  }

 private:
  // A piece that ends the slope exactly at the target.
  std::optional<Piece> levelAtTarget(const RateState& state, double sooner_than) const {
    if (!(state.slope < -kNoSlope)) return std::nullopt;
    const DoubleDouble fall = state.rate - DoubleDouble(target_);
    const DoubleDouble duration = fall * -2.0 / state.slope;
    if (!(duration.value() < sooner_than)) return std::nullopt;
    const Piece piece = state.piece(duration, -state.slope / duration.value());
    return keeps(piece) ? std::optional(piece) : std::nullopt;
  }

  // The slice in which the rate falls the most. If no slice is left to choose, it is the piece that
  // ends the slope.
  std::optional<Piece> steepest(const RateState& state) {
    const double jerk = highestJerk(state.place);
    for (std::size_t i = latest_ > 0 ? latest_ - 1 : 0; i < kJerks.size(); ++i) {
      const Piece piece = state.piece(slice_, kJerks[i] * jerk);
      const RateState after = endOf(piece);
      const bool falls = after.slope <= 0.0 && after.rate.value() > target_;
      if (!falls || !keeps(piece)) continue;
      const std::optional<Piece> end = endOfSlope(after);
      if (after.slope < -kNoSlope && !end) continue;
      latest_ = i;
      end_of_slope_ = end;
      return piece;
    }
    return std::exchange(end_of_slope_, std::nullopt);
  }

  std::optional<Piece> endOfSlope(const RateState& state) const {
    if (!(state.slope < -kNoSlope)) return std::nullopt;
    const double needed = state.slope * state.slope / (2.0 * (state.rate.value() - target_));
    const double highest = highestJerk(state.place);
    for (const double part : kEnds) {
      const double jerk = part * highest;
      const Piece piece = state.piece(-state.slope / jerk, jerk);
      if (jerk > needed && keeps(piece)) return piece;
    }
    return std::nullopt;
  }

  // [1/s^2] The highest jerk of the rate that the motors allow at a place.
  double highestJerk(DoubleDouble place) const {
    double highest = kSteepestJerk;
    for (const LimitedCurve& curve : courses_) {
      const MotionState state = curve.curve->stateAt(splitNanoseconds(place).whole);
      const double speed = std::abs(state.velocity);
      const double jerk = curve.bounds.jerk;
      if (jerk > 0.0 && jerk < highest * speed) highest = jerk / speed;
    }
    return highest;
  }

  bool keeps(const Piece& piece) const {
    return piece.positionAt(piece.duration) < end_ && staysWithin(courses_, piece);
  }

  const std::vector<LimitedCurve>& courses_;
  double target_;
  double slice_;
  DoubleDouble end_;
  std::size_t latest_ = 0;  // the index in kJerks of the last slice
  std::optional<Piece> end_of_slope_;
};

}  // namespace

std::optional<Profile> planJerkLimitedFeedDeceleration(std::int64_t start_ns,
                                                       const MotionState& from, double rate,
                                                       const std::vector<LimitedCurve>& curves,
                                                       double slice, double most,
                                                       DoubleDouble end) {
  if (from.acceleration > 0.0) return std::nullopt;
  std::optional<std::vector<Piece>> pieces =
      JerkLimitedFeedDeceleration(rate, curves, slice, end)
          .plan({from.position, from.velocity, from.acceleration}, most);
  if (!pieces) return std::nullopt;
  keepToTheEnd(*pieces, endOf(pieces->back()).place, rate, end);
  return Profile(start_ns, *std::move(pieces));
}

}  // namespace stepdriver::motion
