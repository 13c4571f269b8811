#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"

namespace stepdriver::console {

/// The findings of a bring-up about one axis.
struct Findings {
  std::string axis;
  bool wrong_way = false;         ///< its plus direction is the user's minus
  bool switches_swapped = false;  ///< min is at the plus end, max at the minus end
  bool min_inverted = false;      ///< the switch that is configured as min reads the wrong way
  bool max_inverted = false;
  std::optional<double> scale;  ///< commanded distance divided by the measured one
};

/// The driver's parameters, corrected according to these findings; nothing else is changed.
///
/// @param parameters all parameters of the node.
config::ConfigValue corrected(config::ConfigValue parameters, const Findings& findings);

/// The changes of corrected(), a sentence for each; empty if there are none.
std::vector<std::string> changesText(const Findings& findings, const config::AxisConfig& config);

}  // namespace stepdriver::console
