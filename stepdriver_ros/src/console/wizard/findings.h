#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"

namespace stepdriver::console {

/// What a bring-up has found out of an axis.
struct Findings {
  std::string axis;
  bool wrong_way = false;         ///< its plus isn't where plus is to be
  bool switches_swapped = false;  ///< min is at the plus end, max at the minus end
  bool min_inverted = false;      ///< the switch that is configured as min reads the wrong way
  bool max_inverted = false;
  std::optional<double> scale;  ///< commanded distance by the measured one

  bool changesAnything() const {
    return wrong_way || switches_swapped || min_inverted || max_inverted || scale;
  }
};

/// The driver's parameters with what they must be by these findings; nothing else is changed.
///
/// @param parameters all of the node's.
config::ConfigValue corrected(config::ConfigValue parameters, const Findings& findings);

/// What corrected() changes, a sentence for each; none where nothing is.
std::vector<std::string> changesText(const Findings& findings, const config::AxisConfig& config);

}  // namespace stepdriver::console
