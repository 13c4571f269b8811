#include "snapshot.h"

#include <algorithm>

namespace stepdriver::machine {
namespace {

const AxisSnapshot::Motion* followed(const AxisSnapshot& axis, const pulse::ChannelState& channel) {
  if (channel.following == 0) return nullptr;
  for (const AxisSnapshot::Motion& motion : axis.motions) {
    if (motion.serial == channel.following) return &motion;
  }
  return nullptr;
}

}  // namespace

axis::AxisState stateOf(const AxisSnapshot& axis, const pulse::ChannelState& live,
                        pulse::Nanoseconds before, pulse::Nanoseconds after) {
  // A count in another microstep mode than the scale's is meaningless.
  const pulse::ChannelState& channel = live.epoch == axis.channel.epoch ? live : axis.channel;
  const auto position_of = [&axis](double count) {
    return axis.origin + count / axis.steps_per_unit;
  };
  axis::AxisState state = axis.state;
  const double count = static_cast<double>(channel.count) + channel.between;
  state.position = position_of(count - static_cast<double>(channel.slack));
  state.planned = state.position;
  state.slack = static_cast<double>(channel.slack) / axis.steps_per_unit;
  state.skew = static_cast<double>(pulse::skewOf(channel.lags, axis.square_lags, axis.motors)) /
               axis.steps_per_unit;
  state.target = axis.held_target.value_or(state.position);
  const AxisSnapshot::Motion* motion = followed(axis, channel);
  if (motion == nullptr) return state;
  const motion::ShapedProfile made = motion->planned.made();
  const motion::MotionState now = made.stateAt(after);
  const auto [low, high] =
      std::minmax({made.stateAt(before).position.value(), now.position.value()});
  const double planned = std::clamp(count, low, high);
  state.planned = position_of(planned - static_cast<double>(channel.slack));
  // While the backlash is taken up, the joint stands still.
  const bool joint_moves = channel.slack == (now.velocity > 0.0 ? axis.backlash : 0);
  state.velocity = joint_moves ? now.velocity / axis.steps_per_unit : 0.0;
  if (motion->slows_down) {
    const double end = made.endPosition().value();
    const double slack =
        static_cast<double>(channel.slack) + end - static_cast<double>(channel.count);
    state.target = position_of(end - std::clamp(slack, 0.0, static_cast<double>(axis.backlash)));
  } else if (motion->target) {
    state.target = *motion->target;
  }
  if (motion->target || motion->slows_down) {
    const pulse::Nanoseconds left = made.endNs() - after;
    state.time_left = static_cast<double>(std::max<pulse::Nanoseconds>(left, 0)) / 1e9;
  }
  return state;
}

double peakRateOf(const AxisSnapshot& axis, const pulse::ChannelState& live) {
  const AxisSnapshot::Motion* motion = followed(axis, live);
  return motion != nullptr ? motion->planned.made().peakSpeed() : 0.0;
}

}  // namespace stepdriver::machine
