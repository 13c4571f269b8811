#pragma once

#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::driver {

/// Whether this version can configure the chip over its UART.
bool hasUart(const DriverChip& chip);

/// The chip as it is when its registers, and not its pins, select the microsteps: with each power
/// of two up to 256, and with its address at MS1 and MS2. For a config::MotorConfig with a
/// config::TmcConfig.
///
/// @throw Error if hasUart() says no.
DriverChip uartChip(DriverChip chip);

}  // namespace stepdriver::driver
