#pragma once

#include <optional>
#include <string>

#include "config/config_reader.h"

namespace stepdriver::config {

/// Its `type` in `input_shaper`.
std::string shaperText(ShaperType type);

/// Reads `input_shaper`.
///
/// @param kind of the axis; empty: unknown, which has been reported.
/// @param config the start speed and the backlash, for checking that there are none.
void readShaper(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config);

}  // namespace stepdriver::config
