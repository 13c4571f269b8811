#pragma once

#include <ros/serialization.h>

#include <cstdint>
#include <string>

namespace stepdriver::node_test {

/// A message or request as roscpp sends it, without its length.
template <typename M>
std::string bytesOf(const M& message) {
  std::string bytes(ros::serialization::serializationLength(message), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

}  // namespace stepdriver::node_test
