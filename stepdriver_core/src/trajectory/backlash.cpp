#include "backlash.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "give_way.h"
#include "nanoseconds.h"
#include "point_to_point/planner.h"
#include "profile/negligible_time.h"
#include "profile/peak_tree.h"
#include "profile/profile_parts.h"

namespace stepdriver::motion {
namespace {

constexpr double kRoundedPosition = 1e-9;  // [microsteps] a smaller difference is rounding
constexpr double kNoTravel = 0.5;          // [microsteps] shorter ways make no step
constexpr double kNoRoom = 0.001;          // less than this part of a limit is no room
constexpr double kLonger = 1.1;
constexpr double kRestedFor = 1e-9;  // [s] a motion that begins later than this begins at rest

// A time at which the joint reverses, and its direction afterwards.
struct Turn {
  double time_s;
  double sign;
};

class Turns {
 public:
  explicit Turns(DoubleDouble start) : furthest_(start) {}

  /// Adds a piece that begins at a time [s].
  void add(const Piece& piece, double start) {
    const double end = piece.duration.value();
    // A turn next to an end of the piece is that end, whose time has no rounding error.
    const double margin = 1e-9 * end;
    for (double t = piece.firstTurn(0.0); t < end; t = piece.firstTurn(t)) {
      if (t > margin && t < end - margin) addPosition(piece.positionAt(t), start + t);
    }
    addPosition(piece.positionAt(piece.duration), start + end);
  }
  const std::vector<Turn>& found() const { return found_; }
  /// Whether both find the same turns from now on. @param later by how much the times of the other
  /// one are earlier.
  bool coincideWith(const Turns& other, double later) const {
    return sign_ != 0.0 && sign_ == other.sign_ && (furthest_ - other.furthest_).hi == 0.0 &&
           std::abs(time_s_ - (other.time_s_ + later)) < kSameTime;
  }

 private:
  static constexpr double kSameTime = 1e-9;  // [s]

  void addPosition(DoubleDouble position, double time_s) {
    const double way = (position - furthest_).value();
    if (sign_ != 0.0 && way * sign_ > 0.0) {
      furthest_ = position;
      time_s_ = time_s;
    } else if (std::abs(way) >= kNoTravel) {
      sign_ = std::copysign(1.0, way);
      found_.push_back({time_s_, sign_});
      furthest_ = position;
      time_s_ = time_s;
    }
  }

  DoubleDouble furthest_;  // the furthest position in the current direction
  double time_s_ = 0.0;    // [s] the time at which the joint reached it
  double sign_ = 0.0;
  std::vector<Turn> found_;
};

std::vector<Turn> turnsOf(const Profile& joint) {
  Turns turns(joint.startPosition());
  for (std::size_t i = 0; i < joint.pieceCount(); ++i) {
    turns.add(joint.piece(i), joint.pieceStart(i).value());
  }
  return turns.found();
}

// Returns the joint's highest values between two times.
using PeaksBetween = std::function<Highest(DoubleDouble, DoubleDouble)>;

// The part of the limits that the joint leaves free between two times; empty if there is almost no
// room.
std::optional<MotionLimits> roomBeside(const PeaksBetween& joint, double from, double to,
                                       const MotionLimits& limits) {
  const Highest meanwhile = joint(from, to);
  const double speed = limits.max_speed - meanwhile.speed;
  const double acceleration = limits.acceleration - meanwhile.acceleration;
  const double jerk = limits.jerk - (limits.jerk > 0.0 ? meanwhile.jerk : 0.0);
  if (speed < kNoRoom * limits.max_speed || acceleration < kNoRoom * limits.acceleration ||
      jerk < kNoRoom * limits.jerk) {
    return std::nullopt;
  }
  return MotionLimits{0.0, speed, acceleration, acceleration, jerk};
}

// The motion that changes the part of the backlash that is taken up. It keeps the limits that the
// joint leaves free until the motion ends; empty if there is no room.
std::optional<Profile> takeUp(const PeaksBetween& joint, double time_s, const MotionState& from,
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

// The part of the backlash that is taken up after a motor's motion, if it was `slack` before.
double slackAfter(const Profile& motor, double slack, std::int64_t backlash) {
  DoubleDouble last = motor.startPosition();
  const auto go_to = [&](DoubleDouble position) {
    slack = std::clamp(slack + (position - last).value(), 0.0, static_cast<double>(backlash));
    last = position;
  };
  for (std::size_t i = 0; i < motor.pieceCount(); ++i) {
    const Piece piece = motor.piece(i);
    const double end = piece.duration.value();
    for (double t = piece.firstTurn(0.0); t < end; t = piece.firstTurn(t))
      go_to(piece.positionAt(t));
    go_to(piece.positionAt(piece.duration));
  }
  return slack;
}

// The motions that take up the backlash, one reversal after the other.
class TakeUps {
 public:
  // `slack` is what the motor's motion has added to the joint's, `taken` what it has taken up.
  TakeUps(double slack, double taken, std::int64_t backlash, const MotionLimits& limits,
          PeaksBetween joint)
      : backlash_(backlash),
        limits_(limits),
        joint_(std::move(joint)),
        taken_(taken),
        last_(0, slack),
        was_cut_(std::abs(taken - slack) >= kNoTravel) {
    if (was_cut_) asked_ = std::llround(slack);
  }

  std::int64_t wanted(const Turn& turn) const { return turn.sign > 0.0 ? backlash_ : 0; }
  MotionState stateAt(const Turn& turn) const { return last_.stateAt(nanoseconds(turn.time_s)); }
  /// Whether the backlash rests at the position that the previous reversal asked for.
  bool restsAt(std::int64_t slack, const Turn& turn) const {
    const MotionState state = stateAt(turn);
    return state.velocity == 0.0 &&
           std::abs((state.position - fromInteger(slack)).hi) < kRoundedPosition;
  }

  /// The motion that a reversal starts, until the next one at the latest; empty if there is nothing
  /// to do. If there is no room it is empty too, and noRoom() says so.
  std::optional<Profile> at(const Turn& turn, const Turn* next) {
    const MotionState from = stateAt(turn);
    const std::int64_t to = wanted(turn);
    was_cut_ = was_cut_ || (asked_ && !restsAt(*asked_, turn));
    asked_ = to;
    if (from.velocity == 0.0 && (from.position - fromInteger(to)).value() == 0.0) return {};
    auto taken = takeUp(joint_, turn.time_s, from, to, limits_);
    if (!taken) {
      no_room_ = turn.time_s;
      return {};
    }
    last_ = *taken;
    constexpr double kEver = Profile::kLongest;
    const std::int64_t until = nanoseconds(next != nullptr ? next->time_s : kEver);
    const DoubleDouble left = secondsOf(until) - secondsOf(last_.startNs());
    return part(last_, 0.0, std::min(last_.duration(), left));
  }
  std::optional<double> noRoom() const { return no_room_; }

  /// Whether the joint isn't where it should be after a motor's motion, though what was added has
  /// come to rest: a reversal came before the motion for the previous one had ended. The motion is
  /// asked for only if there was one.
  template <typename Motor>
  bool isJointBehind(const Motor& motor) const {
    if (!was_cut_ || !asked_) return false;
    const double taken = slackAfter(motor(), taken_, backlash_);
    return std::abs(taken - static_cast<double>(*asked_)) >= kNoTravel;
  }
  /// The motion after that, which begins at rest [s]: the joint, which is beyond its end by less
  /// than the backlash, is brought there from the other side.
  std::optional<Profile> settle(double time_s) {
    return at(Turn{time_s, *asked_ > 0 ? -1.0 : 1.0}, nullptr);
  }

 private:
  std::int64_t backlash_;
  MotionLimits limits_;
  PeaksBetween joint_;
  double taken_;  // at the start
  Profile last_;
  std::optional<double> no_room_;
  std::optional<std::int64_t> asked_;  // by the latest reversal
  bool was_cut_;
};

// What is added to the joint's motion: motions that take up the backlash, which rests before each.
class AddedMotion {
 public:
  explicit AddedMotion(double slack) : slack_(slack) {}

  void add(const Profile& taken) {
    const DoubleDouble start = secondsOf(taken.startNs());
    if (const DoubleDouble rest = start - end_; rest.hi > kNegligibleTime) {
      pieces_.push_back({rest, taken.startPosition()});
    }
    for (const Piece& piece : taken.pieces()) pieces_.push_back(piece);
    end_ = start + taken.duration();
  }
  DoubleDouble end() const { return end_; }
  Profile profile() const { return pieces_.empty() ? Profile(0, slack_) : Profile(0, pieces_); }

 private:
  double slack_;
  std::vector<Piece> pieces_;
  DoubleDouble end_;
};

// The joint's motion plus what is added, which ends with the joint at its end.
Profile motorOf(const Profile& joint, TakeUps& take_ups, AddedMotion added) {
  Profile motor = sum(joint, added.profile());
  if (take_ups.noRoom() || !take_ups.isJointBehind([&] { return motor; })) return motor;
  const double rest = std::max(joint.duration(), added.end()).value() + kRestedFor;
  if (const auto settled = take_ups.settle(rest)) added.add(*settled);
  return sum(joint, added.profile());
}

}  // namespace

MotorPlan planMotor(const Profile& joint, double slack, std::int64_t backlash,
                    const MotionLimits& limits, std::optional<double> taken) {
  const PeakTree peaks(joint);
  TakeUps take_ups(slack, taken.value_or(slack), backlash, limits,
                   [&](DoubleDouble from, DoubleDouble to) { return peaks.between(from, to); });
  const std::vector<Turn> turns = turnsOf(joint);
  AddedMotion added(slack);
  for (std::size_t i = 0; i < turns.size() && !take_ups.noRoom(); ++i) {
    const Turn* next = i + 1 < turns.size() ? &turns[i + 1] : nullptr;
    if (const auto motion = take_ups.at(turns[i], next)) added.add(*motion);
  }
  Profile motor = motorOf(joint, take_ups, std::move(added));
  if (take_ups.noRoom()) return {joint, take_ups.noRoom()};
  return {std::move(motor), {}};
}

// ---- joining ----

struct MotorTail::Plan {
  std::vector<Turn> turns;      // the turns of the tail alone, after its beginning
  std::size_t moves_after = 0;  // the number of pieces up to the first reversal
  // For each reversal: whether the motion for the previous one had ended.
  std::vector<bool> from_rest;
  PeakTree peaks;

  explicit Plan(const Profile& joint) : peaks(joint) {
    Turns all(joint.startPosition());
    for (std::size_t i = 0; i < joint.pieceCount(); ++i) {
      giveWayAt(i);
      all.add(joint.piece(i), joint.pieceStart(i).value());
      if (all.found().empty()) moves_after = i + 1;
    }
    turns = all.found();
  }
};

MotorTail::MotorTail(const Profile& joint, std::int64_t backlash, const MotionLimits& limits)
    : joint_(joint), backlash_(backlash), limits_(limits), motor_(0, 0.0) {
  auto plan = std::make_unique<Plan>(joint);
  const std::vector<Turn>& turns = plan->turns;
  plan->from_rest.assign(turns.size(), false);
  const bool up = !turns.empty() && turns.front().sign > 0.0;
  const double slack = up ? static_cast<double>(backlash) : 0.0;
  TakeUps take_ups(slack, slack, backlash, limits, [&plan](DoubleDouble from, DoubleDouble to) {
    return plan->peaks.between(from, to);
  });
  AddedMotion added(slack);
  for (std::size_t i = 1; i < turns.size() && !take_ups.noRoom(); ++i) {
    giveWay(i);
    plan->from_rest[i] = take_ups.restsAt(take_ups.wanted(turns[i - 1]), turns[i]);
    const Turn* next = i + 1 < turns.size() ? &turns[i + 1] : nullptr;
    if (const auto taken = take_ups.at(turns[i], next)) added.add(*taken);
  }
  motor_ = motorOf(joint, take_ups, std::move(added));
  no_room_ = take_ups.noRoom();
  plan_ = std::move(plan);
}

MotorTail::~MotorTail() = default;

namespace {

// Joining a motion to a tail examines no more than these.
constexpr std::size_t kMostPieces = 1000;
constexpr std::size_t kMostTurns = 64;

// The sections of a motor's motion: the joint's motion, shifted by the part that is taken up, and
// sums of both while that part changes.
class MotorSections {
 public:
  MotorSections(std::shared_ptr<const Profile> joint, double slack)
      : joint_(std::move(joint)), slack_(slack) {}

  void rest(DoubleDouble until) {
    const DoubleDouble from = time_;
    if (!((until - from).hi > kNegligibleTime)) return;
    const DoubleDouble end = std::min(until, joint_->duration());
    if (from < end) sections_.add(Excerpt{joint_, from, end, 1.0, slack_});
    const DoubleDouble left = until - std::max(from, joint_->duration());
    if (left.hi > 0.0) sections_.add(Piece{left, joint_->endPosition() + slack_});
    time_ = until;
  }
  void add(const Profile& taken) {
    if (taken.pieceCount() == 0) return;
    const DoubleDouble start = secondsOf(taken.startNs());
    rest(start);
    const DoubleDouble end = start + taken.duration();
    const Profile both = sum(part(*joint_, start, end), Profile(0, asPieces(taken)));
    sections_.add(asPieces(both));
    slack_ = taken.endPosition();
    time_ = end;
  }
  void add(Excerpt tail) { sections_.add(std::move(tail)); }
  DoubleDouble time() const { return time_; }
  const Sections& sections() const { return sections_; }
  Sections release() { return std::move(sections_); }

 private:
  static std::vector<Piece> asPieces(const Profile& profile) {
    std::vector<Piece> pieces;
    for (const Piece& piece : profile.pieces()) pieces.push_back(piece);
    return pieces;
  }

  std::shared_ptr<const Profile> joint_;
  DoubleDouble slack_;
  DoubleDouble time_;
  Sections sections_;
};

}  // namespace

std::optional<JoinedMotor> MotorTail::join(const std::shared_ptr<const MotorTail>& own,
                                           const std::shared_ptr<const Profile>& joint,
                                           DoubleDouble begin, double slack) const {
  const double later = begin.value();
  // Finds the turns from the start on, until they are those of the tail.
  Turns all(joint->startPosition());
  const std::size_t head = joint->pieceAt(begin);
  for (std::size_t i = 0; i < head; ++i) all.add(joint->piece(i), joint->pieceStart(i).value());
  Turns tail(joint_.startPosition());
  const std::size_t first_move = plan_->moves_after;
  const std::size_t looked_at = std::min(joint_.pieceCount(), kMostPieces + first_move);
  bool coincide = false;
  for (std::size_t i = 0; i < looked_at && !coincide; ++i) {
    // A tail may begin with many pieces that hardly move: skip to its first reversal.
    if (i > kMostPieces && i < first_move) i = first_move;
    if (i >= looked_at) break;
    const double start = joint_.pieceStart(i).value();
    tail.add(joint_.piece(i), start);
    all.add(joint_.piece(i), start + later);
    coincide = all.coincideWith(tail, later);
  }
  if (!coincide && looked_at < joint_.pieceCount()) return std::nullopt;
  std::vector<Turn> turns = all.found();
  const std::size_t known = turns.size();
  const std::size_t same_from = coincide ? tail.found().size() : plan_->turns.size();
  const std::size_t same_to = std::min(plan_->turns.size(), same_from + kMostTurns);
  for (std::size_t i = same_from; i < same_to; ++i) {
    turns.push_back({plan_->turns[i].time_s + later, plan_->turns[i].sign});
  }

  const Profile of_head = part(*joint, 0.0, begin);
  const PeakTree head_peaks(of_head);
  TakeUps take_ups(slack, slack, backlash_, limits_, [&](DoubleDouble from, DoubleDouble to) {
    Highest highest;
    if (from < begin) highest = head_peaks.between(from, std::min(to, begin));
    if (!(begin < to)) return highest;
    return larger(highest, plan_->peaks.between(std::max(from, begin) - begin, to - begin));
  });
  MotorSections sections(joint, slack);
  JoinedMotor joined{Profile(0, 0.0), {{0.0, later}}, {}};
  // Whether the joint isn't where the tail expects it.
  const auto is_behind = [&](const Turn& turn) {
    return take_ups.isJointBehind([&] {
      MotorSections until = sections;
      until.rest(turn.time_s);
      return Profile(0, until.release());
    });
  };
  const Turn* tail_from = nullptr;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const std::size_t of_tail = i < known ? 0 : same_from + i - known;
    if (of_tail > 0 && plan_->from_rest[of_tail] &&
        take_ups.restsAt(take_ups.wanted(turns[i - 1]), turns[i]) && !is_behind(turns[i])) {
      tail_from = &turns[i];
      break;
    }
    const Turn* next = i + 1 < turns.size() ? &turns[i + 1] : nullptr;
    if (const auto taken = take_ups.at(turns[i], next)) {
      sections.add(*taken);
      const double from = static_cast<double>(taken->startNs()) * 1e-9;
      joined.fresh.push_back({from, from + taken->duration().value()});
    }
    if (take_ups.noRoom()) {
      joined.no_room = take_ups.noRoom();
      return joined;
    }
  }
  if (tail_from != nullptr) {
    sections.rest(std::max(begin, secondsOf(nanoseconds(tail_from->time_s))));
    const std::shared_ptr<const Profile> motor(own, &motor_);
    sections.add(Excerpt{motor, sections.time() - begin, motor_.duration()});
  } else if (same_to < plan_->turns.size()) {
    return std::nullopt;
  } else {
    sections.rest(std::max(sections.time(), joint->duration()));
  }
  if (tail_from == nullptr &&
      take_ups.isJointBehind([&] { return Profile(0, sections.sections()); })) {
    const double rest = sections.time().value() + kRestedFor;
    if (const auto settled = take_ups.settle(rest)) {
      sections.add(*settled);
      joined.fresh.push_back({rest, rest + settled->duration().value()});
    }
    joined.no_room = take_ups.noRoom();
  }
  joined.profile = Profile(0, sections.release());
  return joined;
}

std::optional<double> slackAt(const Profile& motor, std::int64_t time_ns, std::int64_t backlash) {
  constexpr std::size_t kMostLookedAt = 500;
  const double most = static_cast<double>(backlash);
  if (backlash == 0) return 0.0;
  if (motor.pieceCount() == 0) return std::nullopt;
  // Goes backwards from turn to turn until the motor has come over the whole backlash: what was
  // before that doesn't matter.
  const DoubleDouble time = secondsOf(std::max<std::int64_t>(0, time_ns - motor.startNs()));
  std::vector<double> turns{motor.stateAt(time_ns).position.value()};
  double lowest = turns.front();
  double highest = turns.front();
  const auto include = [&](DoubleDouble position) {
    turns.push_back(position.value());
    lowest = std::min(lowest, turns.back());
    highest = std::max(highest, turns.back());
  };
  std::size_t index = motor.pieceAt(time);
  for (std::size_t pieces = 0; highest - lowest < most; --index, ++pieces) {
    if (pieces == kMostLookedAt) return std::nullopt;
    const Piece piece = motor.piece(index);
    const double until = std::min((time - motor.pieceStart(index)).value(), piece.duration.value());
    std::vector<double> own;
    for (double t = piece.firstTurn(0.0); t < until; t = piece.firstTurn(t)) own.push_back(t);
    for (auto turn = own.rbegin(); turn != own.rend(); ++turn) include(piece.positionAt(*turn));
    include(piece.p0);
    if (index == 0) break;
  }
  if (highest - lowest < most) return std::nullopt;
  double slack = 0.0;
  for (std::size_t i = turns.size(); i-- > 1;) {
    slack = std::clamp(slack + turns[i - 1] - turns[i], 0.0, most);
  }
  return slack;
}

}  // namespace stepdriver::motion
