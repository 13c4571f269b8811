#include <algorithm>
#include <cmath>

#include "axis_impl.h"

namespace stepdriver::axis {

void Axis::Impl::refuseMicrosteps(int wanted) {
  const auto& known = chip.microsteps;
  if (chip.modes.empty()) {
    refuse("the microsteps of a " + chip.title +
           " are set by its DIP switches while its power is off, not by software; they are "
           "configured as `microsteps`, here " +
           std::to_string(microsteps));
  }
  if (std::find(known.begin(), known.end(), wanted) == known.end()) {
    std::string list;
    for (const int mode : known) list += (list.empty() ? "" : ", ") + std::to_string(mode);
    refuse("a " + chip.title + " has no 1/" + std::to_string(wanted) + " mode; it has " + list);
  }
  if (!pins.hasMode()) {
    refuse("the microstep pins aren't configured: the board decides, here 1/" +
           std::to_string(microsteps));
  }
  refuseWhileMoving("its microsteps are changed");
  if (!fault.empty()) refuse("at fault: " + fault + "; call recover first");
}

std::int64_t Axis::Impl::nearestCommon(int wanted) {
  const std::int64_t count = harvest().count;
  const std::int64_t index = count - home_count;
  if (chip::keepsPosition(index, microsteps, wanted)) return count;
  const double unit = static_cast<double>(microsteps) / std::min(microsteps, wanted);
  return home_count + std::llround(std::round(static_cast<double>(index) / unit) * unit);
}

void Axis::Impl::changeMicrosteps(int wanted) {
  const pulse::ChannelState state = harvest();
  const std::int64_t count = state.count;
  const double kept = position();
  const std::int64_t index = (count - home_count) * wanted / microsteps;
  const bool home_stays = home_count * wanted % microsteps == 0;
  const std::int64_t new_home = home_stays ? home_count * wanted / microsteps : 0;
  const double scale = static_cast<double>(wanted) / microsteps;
  const std::int64_t play = std::llround(config.backlash * stepsPerUnit() * scale);
  const std::int64_t slack =
      std::min<std::int64_t>(std::llround(static_cast<double>(state.slack) * scale), play);
  try {
    writePins(pins.mode(microsteps, wanted), {{new_home + index, slack, play}});
  } catch (const GpioError&) {
    mode_failed_ = wanted;
    throw;
  }
  microsteps = wanted;
  home_count = new_home;
  // Where Home has no count in the new mode, the counting starts anew from it, at the same
  // position; and what is taken up of the backlash need not be whole microsteps of it.
  if (!home_stays || state.slack != 0) {
    origin = kept - static_cast<double>(new_home + index - slack) / stepsPerUnit();
  }
}

}  // namespace stepdriver::axis
