#pragma once

#include <memory>
#include <string>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::gpio {

/// Adds the PWM outputs of the kernel to a backend: lines with a name as PwmLine::text() makes it.
/// All other lines are those of the base.
///
/// A request exports the channel, sets its period, and enables it with the length of its safe
/// level. A thread for each chip writes the lengths, so that a write of the pulse thread never
/// waits for a file: Lines::lateWrites() has its end. A write of any other thread waits until the
/// length is written. Before release the safe level is written; the channel stays exported and
/// enabled.
///
/// @param folder with the kernel's PWM chips: /sys/class/pwm.
std::unique_ptr<Backend> withPwm(std::unique_ptr<Backend> base, std::string folder);

}  // namespace stepdriver::gpio
