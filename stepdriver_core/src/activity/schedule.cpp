#include "schedule.h"

#include <fmt/format.h>

#include <algorithm>

#include "point_motion.h"
#include "profile/errors.h"
#include "stepdriver_core/error.h"

namespace stepdriver::activity {
namespace {

// How long before its beginning a motion is given to the engine: on a busy computer, this thread
// may be late. It is short, because a stop that comes meanwhile begins with that motion.
constexpr pulse::Nanoseconds kAhead = 5'000'000;

const EarlyEnd kReplacedByLater{axis::MoveEnd::kReplaced,
                                "another trajectory was to begin before it or at the same time"};

// The axis that made it end, and those that were to move with it.
void reportDropped(const std::vector<Order>& orders, const axis::AxisModel* because,
                   const EarlyEnd& why) {
  for (const Order& order : orders) {
    axis::MoveResult result;
    result.end = order.axis == because ? why.end : axis::MoveEnd::kCompanion;
    result.position = order.axis->positionNow();
    result.message = fmt::format("{}: the trajectory did not begin: {}", because->name(), why.text);
    order.goal.outcome->set(std::move(result));
  }
}

/// The client has its answer; it is told by the outcome if the motion doesn't begin.
class Beginning : public AnswerSink {
 public:
  explicit Beginning(std::vector<Order> orders) : orders_(std::move(orders)), call(*this, 0) {}
  void answer(CallId /*call*/, Reply reply) override {
    if (!reply.failure) return;
    reportDropped(orders_, orders_.front().axis, {axis::MoveEnd::kStopped, reply.failure->text});
  }

 private:
  std::vector<Order> orders_;

 public:
  PendingCall call;  // ends first
};

}  // namespace

const Schedule::Entry* Schedule::before(const Entry& entry, const axis::AxisModel& axis) const {
  const Entry* latest = nullptr;
  for (const Entry& other : entries_) {
    if (other.id == entry.id || other.motion.begins_ns >= entry.motion.begins_ns) continue;
    for (const Order& order : other.motion.orders) {
      if (order.axis == &axis) latest = &other;
    }
  }
  return latest;
}

Schedule::Source Schedule::sourceOf(const Entry& entry, const axis::AxisModel& axis) const {
  if (const Entry* other = before(entry, axis)) return {other->id, other->version};
  const motor::Motion* motion = axis.motor.motions().latest();
  return {0, motion != nullptr ? motion->serial : 0};
}

void Schedule::plan(Entry& entry) const {
  const LaterMotion& motion = entry.motion;
  std::vector<motion::PathStart> starts;
  std::vector<Source> from;
  for (const Order& order : motion.orders) {
    const Entry* other = before(entry, *order.axis);
    from.push_back(sourceOf(entry, *order.axis));
    if (other == nullptr) {
      starts.push_back(order.axis->laterPathStart(motion.begins_ns));
      continue;
    }
    for (std::size_t i = 0; i < other->motion.orders.size(); ++i) {
      if (other->motion.orders[i].axis != order.axis) continue;
      starts.push_back(order.axis->laterPathStart(motion.begins_ns, *other->plans[i]));
    }
  }
  try {
    const auto path = motion.join(starts);
    const motion::Profile along =
        path->plan(motion.begins_ns, path->begin(), context_.mode.speed_override);
    std::vector<std::shared_ptr<const motion::Profile>> plans;
    for (std::size_t i = 0; i < motion.orders.size(); ++i) {
      plans.push_back(std::make_shared<const motion::Profile>(path->profileOf(i, along)));
    }
    entry.plans = std::move(plans);
  } catch (const motion::TooLong& error) {
    motion.orders.front().axis->refuse(error.what());
  }
  entry.from = std::move(from);
  ++entry.version;
}

std::vector<axis::Move> Schedule::add(LaterMotion motion) {
  Entry entry;
  entry.id = ++accepted_;
  for (const Order& order : motion.orders) {
    entry.stops.push_back(order.axis->stops);
    entry.ended.push_back(order.axis->motor.state().ended);
  }
  entry.motion = std::move(motion);
  plan(entry);
  std::vector<axis::Move> moves;
  for (std::size_t i = 0; i < entry.motion.orders.size(); ++i) {
    const Order& order = entry.motion.orders[i];
    const motion::PlannedMotion planned = order.axis->motor.shaped(*entry.plans[i]);
    axis::Move& move = moves.emplace_back(
        moveOf(*order.axis, order.goal, planned.made(), 0.0, entry.motion.orders));
    move.id = order.goal.move;
    move.outcome = order.goal.outcome;
  }
  for (const Order& order : entry.motion.orders) {
    dropIf([&](const Entry& other) { return other.motion.begins_ns >= entry.motion.begins_ns; },
           *order.axis, kReplacedByLater);
  }
  const auto later = std::find_if(entries_.begin(), entries_.end(), [&entry](const Entry& other) {
    return other.motion.begins_ns > entry.motion.begins_ns;
  });
  entries_.insert(later, std::move(entry));
  return moves;
}

bool Schedule::has(const axis::AxisModel& axis) const {
  return std::any_of(entries_.begin(), entries_.end(), [&axis](const Entry& entry) {
    const auto& orders = entry.motion.orders;
    return std::any_of(orders.begin(), orders.end(),
                       [&axis](const Order& order) { return order.axis == &axis; });
  });
}

template <typename Which>
bool Schedule::dropIf(const Which& which, const axis::AxisModel& axis, const EarlyEnd& why) {
  bool any = false;
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    const auto& orders = entry->motion.orders;
    const bool drops = std::any_of(orders.begin(), orders.end(), [&](const Order& order) {
      return order.axis == &axis && which(*entry);
    });
    if (drops) reportDropped(orders, &axis, why);
    any = any || drops;
    entry = drops ? entries_.erase(entry) : entry + 1;
  }
  return any;
}

void Schedule::drop(const axis::AxisModel& axis, const EarlyEnd& why) {
  dropIf([](const Entry& /*any*/) { return true; }, axis, why);
}

void Schedule::dropAll(const EarlyEnd& why) {
  for (const Entry& entry : entries_) {
    reportDropped(entry.motion.orders, entry.motion.orders.front().axis, why);
  }
  entries_.clear();
}

bool Schedule::dropMove(const axis::AxisModel& axis, std::uint64_t move, const EarlyEnd& why) {
  const auto has_it = [&](const Entry& entry) {
    const auto& orders = entry.motion.orders;
    return std::any_of(orders.begin(), orders.end(), [&](const Order& order) {
      return order.axis == &axis && order.goal.move == move;
    });
  };
  return dropIf(has_it, axis, why);
}

// Whether something has happened since it was accepted that it can't outlive.
std::optional<Schedule::Drop> Schedule::whyNot(Entry& entry) const {
  const auto& orders = entry.motion.orders;
  bool plans_changed = false;
  for (std::size_t i = 0; i < orders.size(); ++i) {
    const axis::AxisModel& axis = *orders[i].axis;
    const pulse::ChannelState& state = axis.motor.state();
    if (axis.fault) {
      const bool stopped = axis.fault.isEmergencyStop();
      return Drop{
          &axis,
          {stopped ? axis::MoveEnd::kEmergencyStop : axis::MoveEnd::kFault, axis.fault.what()}};
    }
    if (axis.stops != entry.stops[i]) {
      return Drop{&axis, {axis::MoveEnd::kStopped, "it was stopped"}};
    }
    if (state.ended != entry.ended[i] && state.end != pulse::EndReason::kDone) {
      const bool by_switch =
          state.end == pulse::EndReason::kEndstopMin || state.end == pulse::EndReason::kEndstopMax;
      return Drop{&axis,
                  {axis::MoveEnd::kStopped,
                   by_switch ? "an endstop was met" : "the motion before it was stopped"}};
    }
    entry.ended[i] = state.ended;
    if (axis.pathAxis() != entry.motion.facts[i]) {
      return Drop{&axis, {axis::MoveEnd::kStopped, "its limits, scale or position were changed"}};
    }
    plans_changed = plans_changed || !(sourceOf(entry, axis) == entry.from[i]);
  }
  if (!plans_changed) return std::nullopt;
  try {
    plan(entry);
  } catch (const Error& error) {
    return Drop{orders.front().axis, {axis::MoveEnd::kStopped, error.what()}};
  }
  return std::nullopt;
}

void Schedule::poll() {
  for (std::size_t i = 0; i < entries_.size();) {
    if (const std::optional<Drop> drop = whyNot(entries_[i])) {
      reportDropped(entries_[i].motion.orders, drop->axis, drop->why);
      entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

std::vector<axis::AxisModel*> Schedule::toWake() const {
  std::vector<axis::AxisModel*> axes;
  for (const Entry& entry : entries_) {
    for (const Order& order : entry.motion.orders) {
      if (order.axis->mustWake()) axes.push_back(order.axis);
    }
  }
  return axes;
}

// DIR may have to be set when the order is taken, and the port takes steps before their times.
pulse::Nanoseconds Schedule::lead(const Entry& entry) const {
  pulse::Nanoseconds turn = 0;
  for (const Order& order : entry.motion.orders) turn = std::max(turn, order.axis->turnTime());
  return kAhead + turn + context_.horizon;
}

std::optional<Schedule::Due> Schedule::takeDue() {
  if (entries_.empty()) return std::nullopt;
  Entry& first = entries_.front();
  if (context_.motionNow() < first.motion.begins_ns - lead(first)) return std::nullopt;
  LaterMotion motion = std::move(first.motion);
  entries_.erase(entries_.begin());
  const auto beginning = std::make_shared<Beginning>(motion.orders);
  Due due;
  due.call = {beginning, &beginning->call};
  const auto join = [join = std::move(motion.join), axes = axesOf(motion.orders)](std::int64_t at) {
    return join(startsOf(axes, at));
  };
  due.activity = std::make_unique<FollowGoal>(context_, std::move(motion.orders), join, due.call,
                                              nullptr, motion.begins_ns);
  return due;
}

pulse::Nanoseconds Schedule::due() const {
  if (entries_.empty()) return pulse::kNever;
  const Entry& first = entries_.front();
  return first.motion.begins_ns - lead(first) + context_.slipped;
}

}  // namespace stepdriver::activity
