#pragma once

#include <optional>
#include <string>

#include "latched_messages.h"

namespace stepdriver::ros_node {

/// Asks the ROS master itself; no question takes much longer than a second.
class MasterDirectory : public PublisherDirectory {
 public:
  std::optional<Publishers> publishers() override;
  std::optional<std::string> addressOf(const std::string& node) override;
};

}  // namespace stepdriver::ros_node
