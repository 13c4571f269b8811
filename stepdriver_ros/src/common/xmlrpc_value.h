#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::ros_node {

/// What the parameter server holds, as the core's reader takes it. Nothing is converted or left
/// out: what the reader has no type for (dates, binary data) becomes nothing, which it refuses.
config::ConfigValue configValue(XmlRpc::XmlRpcValue value);

}  // namespace stepdriver::ros_node
