#pragma once

#include <string>
#include <vector>

#include "config/config_reader.h"
#include "config/used_lines.h"
#include "stepdriver_core/config/io_config.h"

namespace stepdriver::config {

/// Read the map `outputs` or `inputs` of a machine, if there is one, in the order of the names.
/// @param axes whose positions can switch outputs; nullptr: they are wrong, and not compared with.
std::vector<OutputConfig> readOutputs(ConfigReader& machine, UsedLines& used,
                                      const std::vector<AxisConfig>* axes);
std::vector<InputConfig> readInputs(ConfigReader& machine, UsedLines& used);

/// Adds why the position of an axis can't switch one of these outputs.
void checkCompares(const std::vector<OutputConfig>& outputs, const std::vector<AxisConfig>& axes,
                   std::vector<ConfigIssue>& issues);

/// These maps for the readers above, without what positions switch. @pre The names differ.
ConfigValue::Map writeOutputs(const std::vector<OutputConfig>& outputs);
ConfigValue::Map writeInputs(const std::vector<InputConfig>& inputs);

}  // namespace stepdriver::config
