#pragma once

#include <string>
#include <vector>

#include "session.h"

namespace stepdriver::console {

/// A linear axis of 80 steps/mm at 16 microsteps and 100 mm/s, with both endstops.
inline config::AxisConfig axisConfig(const std::string& name) {
  config::AxisConfig config;
  config.name = name;
  config.microsteps = 16;
  config.steps_per_unit = 80000.0;
  config.max_speed = 0.1;
  config.endstop_min = config::Endstop{{name + "_min", true}};
  config.endstop_max = config::Endstop{{name + "_max", true}};
  return config;
}

/// The same, enabled and at rest.
inline AxisView axisView(const std::string& name) {
  AxisView view;
  view.name = name;
  view.enabled = true;
  view.microsteps = 16;
  return view;
}

/// A session with these axes, whose states came at 0 s.
inline Session sessionWith(const std::vector<AxisView>& axes,
                           const std::vector<config::AxisConfig>& configs) {
  Session session("/stepdriver", {});
  session.driver().configure(configs);
  session.update(axes, 0.0);
  for (const AxisView& axis : axes) {
    session.driver().updateEndstops(axis.name, axis.min_active, axis.max_active);
  }
  return session;
}

/// The same with the configuration above.
inline Session sessionWith(const std::vector<AxisView>& axes) {
  std::vector<config::AxisConfig> configs;
  configs.reserve(axes.size());
  for (const AxisView& axis : axes) configs.push_back(axisConfig(axis.name));
  return sessionWith(axes, configs);
}

}  // namespace stepdriver::console
