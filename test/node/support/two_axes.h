#pragma once

#include <string>

#include "support/node_under_test.h"

namespace stepdriver::node_test {

/// Adds an axis y, like the node's axis x but with half the speed and no endstops.
inline void addSecondAxis(NodeUnderTest& node) {
  node.set("axes/y/driver", "a4988");
  node.set("axes/y/joint", "y_joint");
  for (const char* pin : {"step", "dir", "enable"}) {
    node.set(std::string("axes/y/pins/") + pin, std::string("y_") + pin);
  }
  node.set("axes/y/microsteps", 16);
  node.set("axes/y/steps_per_mm", 80.0);
  node.set("axes/y/max_speed_mm_s", 50.0);
  node.set("axes/y/acceleration_mm_s2", 500.0);
  node.set("axes/y/min_position_mm", -100.0);
  node.set("axes/y/max_position_mm", 200.0);
  node.set("axes/y/enable_on_start", true);
}

}  // namespace stepdriver::node_test
