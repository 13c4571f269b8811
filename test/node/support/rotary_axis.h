#pragma once

#include "support/node_under_test.h"

namespace stepdriver::node_test {

/// Makes the node's axis x one in degrees instead of the linear one.
inline void makeRotary(NodeUnderTest& node) {
  node.erase("axes/x");
  node.set("axes/x/driver", "drv8825");
  node.set("axes/x/joint", "x_joint");
  node.set("axes/x/pins/step", "x_step");
  node.set("axes/x/pins/dir", "x_dir");
  node.set("axes/x/pins/enable", "x_enable");
  node.set("axes/x/microsteps", 16);
  node.set("axes/x/full_steps_per_round", 200);
  node.set("axes/x/max_speed_deg_s", 180.0);
  node.set("axes/x/acceleration_deg_s2", 360.0);
  node.set("axes/x/enable_on_start", true);
}

}  // namespace stepdriver::node_test
