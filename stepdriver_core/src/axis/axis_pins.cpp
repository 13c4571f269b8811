#include "axis_impl.h"

namespace stepdriver::axis {

void Axis::Impl::writePins(const pulse::PinSequence& sequence,
                           std::optional<pulse::Command::Scale> scale) {
  pulse::Command command;
  command.kind = pulse::Command::Kind::kPins;
  command.channel = channel;
  command.serial = ++serial_;
  command.pins = sequence;
  command.scale = scale;
  driver.post(command);
  pulse::ChannelState state;
  driver.waitFor([&] {
    state = driver.engine().channel(channel);
    return state.pins_done == command.serial || state.pins_failed == command.serial ||
           state.refused == command.serial;
  });
  rest_since = driver.clock().now();
  harvest();
  if (state.pins_failed == command.serial) {
    throw GpioError(config.name + ": " + failureText(state.failure));
  }
  if (state.refused == command.serial) refuse("it moves");
}

void Axis::Impl::restorePins() {
  if (!pins_doubtful_) return;
  const bool by_others =
      pins.hasEnable() && axis_lines.enable_line->isWantedByOthers(on_enable_line_);
  writePins(pins.restore(isEnabled() || by_others, isAsleep()));
  // Each pin on the way back that the failed change did not reach is where it should be already.
  if (mode_failed_ != 0) writePins(pins.mode(mode_failed_, microsteps));
  mode_failed_ = 0;
  pins_doubtful_ = false;
}

void Axis::Impl::resetFaultyChip() {
  if (!config.fault || isAsleep()) return;
  const auto faulty = [this] { return readInput(axis_lines.fault) == 0; };
  if (!faulty()) return;
  if (pins.hasReset()) {
    writePins(pins.reset());
    noteUnpowered();
    noteHome();
    driver.waitFor(
        [this] { return driver.clock().now() >= driver.engine().channel(channel).ready; });
  }
  if (faulty()) {
    refuse(std::string("the driver chip still reports a fault on nFAULT") +
           (pins.hasReset() ? "" : "; RESET isn't wired, so only its power ends that"));
  }
}

}  // namespace stepdriver::axis
