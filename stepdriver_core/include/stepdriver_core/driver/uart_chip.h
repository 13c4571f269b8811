#pragma once

#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::driver {

/// Whether this version can configure the chip over its UART.
bool hasUart(const DriverChip& chip);

/// The chip as it is when its registers, and not its pins, select the microsteps: it has each power
/// of two up to 256, and its address is at MS1 and MS2. A config::MotorConfig with a
/// config::TmcConfig has this chip.
///
/// @throw Error if hasUart() says no.
DriverChip uartChip(DriverChip chip);

}  // namespace stepdriver::driver
