#pragma once

#include <string>
#include <vector>

#include "config/config_reader.h"
#include "config/used_lines.h"
#include "stepdriver_core/config/io_config.h"

namespace stepdriver::config {

/// Read the map `outputs` or `inputs` of a machine, if there is one, in the order of the names.
std::vector<OutputConfig> readOutputs(ConfigReader& machine, UsedLines& used);
std::vector<InputConfig> readInputs(ConfigReader& machine, UsedLines& used);

/// These maps for the readers above. @pre The names differ.
ConfigValue::Map writeOutputs(const std::vector<OutputConfig>& outputs);
ConfigValue::Map writeInputs(const std::vector<InputConfig>& inputs);

}  // namespace stepdriver::config
