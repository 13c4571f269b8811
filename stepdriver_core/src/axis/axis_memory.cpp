#include <cmath>

#include "axis_impl.h"
#include "message_text.h"

namespace stepdriver::axis {
namespace {

using Lock = std::lock_guard<std::mutex>;

}  // namespace

std::optional<AxisMemory> Axis::memory() {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  if (axis.moving()) return std::nullopt;
  const pulse::ChannelState state = axis.harvest();
  AxisMemory memory;
  memory.kind = axis.config.kind;
  memory.steps_per_unit = axis.config.steps_per_unit;
  memory.position = axis.position();
  memory.slack = static_cast<double>(state.slack) / axis.stepsPerUnit();
  memory.valid = axis.position_valid;
  memory.homed = axis.homed;
  memory.at_home = axis.isAtHome();
  return memory;
}

void Axis::restore(const AxisMemory& kept, bool clean) {
  const Lock lock(impl_->mutex);
  Impl& axis = *impl_;
  if (kept.kind != axis.config.kind || kept.steps_per_unit != axis.config.steps_per_unit) {
    axis.position_note = "the position was kept for another axis, of " +
                         numberText(kept.steps_per_unit) + " steps per " +
                         (kept.kind == Kind::kLinear ? "m" : "rad");
    return;
  }
  const double scale = axis.stepsPerUnit();
  const std::int64_t play = axis.backlash();
  const auto slack = std::min<std::int64_t>(std::llround(kept.slack * scale), play);
  const std::int64_t count = axis.harvest().count;
  if (play != 0) axis.writePins({}, {{count, slack, play}});
  axis.origin = kept.position - static_cast<double>(axis.jointCount()) / scale;
  axis.position_note = axis.whyUnverified(kept, clean);
  axis.position_valid = axis.position_note.empty();
  axis.homed = axis.position_valid && kept.homed;
}

void Axis::notePosition(const std::string& why) {
  const Lock lock(impl_->mutex);
  impl_->position_note = why;
}

std::string Axis::Impl::whyUnverified(const AxisMemory& kept, bool clean) const {
  if (!clean) return "the node that kept this position wasn't shut down";
  if (!kept.valid) return "the position couldn't be trusted when it was kept";
  if (!config.holds_position_unpowered) {
    return "the motor had no current in between, and holds_position_unpowered isn't set";
  }
  if (!kept.at_home) {
    return "the chip began anew in between, from where its motor isn't: up to two full steps off";
  }
  return "";
}

}  // namespace stepdriver::axis
