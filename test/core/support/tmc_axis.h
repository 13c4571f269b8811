#pragma once

#include <string>

#include "bench.h"
#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::test {

/// linearAxis() with a TMC2209 of 0.11 Ohm on the UART /dev/serial0, at 0.8 A.
inline config::AxisConfig tmcAxis(const std::string& name = "x", int address = 0) {
  config::AxisConfig config = linearAxis(name, "tmc2209");
  config.driver = driver::registerChip(config.driver);
  for (config::Pin* pin : {&config.pins.ms1, &config.pins.ms2, &config.pins.ms3, &config.pins.sleep,
                           &config.pins.reset}) {
    pin->line.clear();
  }
  config.tmc.emplace();
  config.tmc->port = "/dev/serial0";
  config.tmc->address = address;
  config.tmc->sense_resistor = 0.11;
  config.tmc->run_current = 0.8;
  config.tmc->hold_current = 0.4;
  return config;
}

/// The same with a driver on SPI.
inline config::AxisConfig spiAxis(const std::string& driver, const std::string& name = "x",
                                  const std::string& device = "/dev/spidev0.0") {
  config::AxisConfig config = tmcAxis(name);
  config.driver = driver::registerChip(driver::driverChip(driver));
  config.tmc->port = device;
  config.tmc->baud = 0;
  return config;
}

}  // namespace stepdriver::test
