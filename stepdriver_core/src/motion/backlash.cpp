#include "stepdriver_core/motion/backlash.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "stepdriver_core/motion/planner.h"
#include "stepdriver_core/motion/profile_parts.h"
#include "stepdriver_core/motion/profile_peaks.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoWay = 0.5;     // microsteps
constexpr double kNoRoom = 0.001;  // of a limit
constexpr double kLonger = 1.1;

// The joint goes the other way from a time on.
struct Turn {
  double time_s;
  double sign;
};

class Turns {
 public:
  explicit Turns(DoubleDouble start) : furthest_(start) {}

  void take(DoubleDouble position, double time_s) {
    const double way = (position - furthest_).value();
    if (sign_ != 0.0 && way * sign_ > 0.0) {
      furthest_ = position;
      time_s_ = time_s;
    } else if (std::abs(way) >= kNoWay) {
      sign_ = std::copysign(1.0, way);
      found_.push_back({time_s_, sign_});
      furthest_ = position;
      time_s_ = time_s;
    }
  }
  const std::vector<Turn>& found() const { return found_; }

 private:
  DoubleDouble furthest_;  // in the direction of now
  double time_s_ = 0.0;    // when it came there
  double sign_ = 0.0;
  std::vector<Turn> found_;
};

std::vector<Turn> turnsOf(const Profile& joint) {
  if (joint.pieces().empty()) return {};
  Turns turns(joint.pieces().front().p0);
  for (std::size_t i = 0; i < joint.pieces().size(); ++i) {
    const Piece& piece = joint.pieces()[i];
    const double start = joint.pieceStart(i).value();
    const double end = piece.duration.value();
    for (double t = piece.firstTurn(0.0); t < end; t = piece.firstTurn(t)) {
      turns.take(piece.positionAt(t), start + t);
    }
    turns.take(piece.positionAt(piece.duration), start + end);
  }
  return turns.found();
}

double peakJerk(const Profile& profile) {
  double peak = 0.0;
  for (const Piece& piece : profile.pieces()) peak = std::max(peak, std::abs(piece.j));
  return peak;
}

// What the joint leaves of the limits between two times; none where that is next to nothing.
std::optional<MotionLimits> roomBeside(const Profile& joint, double from, double to,
                                       const MotionLimits& limits) {
  const Profile meanwhile = part(joint, from, to);
  const ProfilePeaks peaks = profilePeaks(meanwhile);
  const double speed = limits.max_speed - std::abs(peaks.velocity.value);
  const double acceleration = limits.acceleration - std::abs(peaks.acceleration.value);
  const double jerk = limits.jerk - (limits.jerk > 0.0 ? peakJerk(meanwhile) : 0.0);
  if (speed < kNoRoom * limits.max_speed || acceleration < kNoRoom * limits.acceleration ||
      jerk < kNoRoom * limits.jerk) {
    return std::nullopt;
  }
  return MotionLimits{0.0, speed, acceleration, acceleration, jerk};
}

std::int64_t nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

// Moves what is taken up, in the time that it needs itself; none where there is no room.
std::optional<Profile> takeUp(const Profile& joint, double time_s, const MotionState& from,
                              std::int64_t to, const MotionLimits& limits) {
  double until = time_s + 1e-6;
  while (const auto room = roomBeside(joint, time_s, until, limits)) {
    Profile taken = planMove(nanoseconds(time_s), from, to, *room).profile;
    const double end = time_s + taken.duration().value();
    if (end <= until) return taken;
    until = time_s + kLonger * (end - time_s);
  }
  return std::nullopt;
}

// Rests before its start too.
void append(std::vector<Piece>& pieces, DoubleDouble& time, DoubleDouble position,
            const Profile& profile, DoubleDouble until) {
  const DoubleDouble start = fromInteger(profile.startNs()) / DoubleDouble(1e9);
  if (const DoubleDouble rest = start - time; rest.hi > 0.0) pieces.push_back({rest, position});
  const DoubleDouble length = std::min(profile.duration(), until - start);
  const Profile moved = part(profile, 0.0, length);
  pieces.insert(pieces.end(), moved.pieces().begin(), moved.pieces().end());
  time = start + length;
}

}  // namespace

MotorPlan planMotor(const Profile& joint, double slack, std::int64_t backlash,
                    const MotionLimits& limits) {
  const std::vector<Turn> turns = turnsOf(joint);
  std::vector<Piece> pieces;
  DoubleDouble time;
  Profile last(0, slack);
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const Turn& turn = turns[i];
    const MotionState from = last.stateAt(nanoseconds(turn.time_s));
    const std::int64_t to = turn.sign > 0.0 ? backlash : 0;
    if (from.velocity == 0.0 && (from.position - fromInteger(to)).value() == 0.0) continue;
    const auto taken = takeUp(joint, turn.time_s, from, to, limits);
    if (!taken) return {joint, turn.time_s};
    last = *taken;
    constexpr double kEver = Profile::kLongest;
    const std::int64_t next = nanoseconds(i + 1 < turns.size() ? turns[i + 1].time_s : kEver);
    append(pieces, time, from.position, last, fromInteger(next) / DoubleDouble(1e9));
  }
  const Profile offset = pieces.empty() ? Profile(0, slack) : Profile(0, std::move(pieces));
  return {sum(joint, offset), {}};
}

}  // namespace stepdriver::motion
