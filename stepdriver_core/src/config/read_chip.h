#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "config/config_reader.h"

namespace stepdriver::config {

constexpr int kFinestMicrosteps = 256;

/// Drivers that names mean instead of the named ones: of axes that a program has made itself.
using OwnChips = std::map<std::string, driver::DriverChip>;

/// The words for them in `chip`.
std::string stepInputsText(driver::StepInputs inputs);
std::string faultEndText(driver::FaultEnd end);

/// The map `timing` of a driver.
ConfigValue::Map writtenTiming(const driver::Timing& timing);

/// Reads `driver`, `chip` and `timing`: a named chip with the overrides of the configuration, or,
/// for `driver: step_dir`, a chip that is described by the configuration alone.
///
/// @param reader of an axis, or of one of its motors.
/// @param pins the keys of the pins that are given for the chip.
/// @return empty if there is no such driver; then nothing that depends on it is checked.
std::optional<driver::DriverChip> readChip(ConfigReader& reader, const std::set<std::string>& pins,
                                           const OwnChips& own);

}  // namespace stepdriver::config
