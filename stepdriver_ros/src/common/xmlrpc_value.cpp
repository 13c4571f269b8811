#include "xmlrpc_value.h"

#include <string>
#include <utility>

namespace stepdriver::ros_node {

using XmlRpc::XmlRpcValue;

// The values are copied, because XmlRpcValue's accessors are not const.
config::ConfigValue configValue(XmlRpcValue value) {  // NOLINT(performance-unnecessary-value-param)
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return {static_cast<bool&>(value)};
    case XmlRpcValue::TypeInt:
      return {static_cast<int&>(value)};
    case XmlRpcValue::TypeDouble:
      return {static_cast<double&>(value)};
    case XmlRpcValue::TypeString:
      return {static_cast<std::string&>(value)};
    case XmlRpcValue::TypeArray: {
      config::ConfigValue::List list;
      for (int i = 0; i < value.size(); ++i) list.push_back(configValue(value[i]));
      return {std::move(list)};
    }
    case XmlRpcValue::TypeStruct: {
      config::ConfigValue::Map map;
      for (auto& entry : value) map.emplace(entry.first, configValue(entry.second));
      return {std::move(map)};
    }
    default:
      return {};
  }
}

}  // namespace stepdriver::ros_node
