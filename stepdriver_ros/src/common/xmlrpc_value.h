#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include "stepdriver_core/config/config_value.h"

namespace stepdriver::ros_node {

/// Converts parameters for the core's reader. No value is converted or left out: a type that the
/// reader doesn't have (dates, binary data) becomes "nothing", which the reader refuses.
config::ConfigValue configValue(XmlRpc::XmlRpcValue value);

}  // namespace stepdriver::ros_node
