#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace stepdriver::ros_node {

// What TCPROS sends: each part has its length before it.

constexpr std::size_t kLengthBytes = 4;

/// @param bytes kLengthBytes of them, the lowest first.
std::uint32_t readLength(std::string_view bytes);
std::string lengthBytes(std::size_t length);

/// The fields by which the two ends of a connection introduce themselves.
using ConnectionHeader = std::map<std::string, std::string>;

/// Unlike ros::Header::parse(), it doesn't trust the lengths in the data.
///
/// @param bytes of a header, without its length.
/// @return no value if the bytes aren't a header.
std::optional<ConnectionHeader> readHeader(std::string_view bytes);

/// @return a header with its length.
std::string headerBytes(const ConnectionHeader& header);

}  // namespace stepdriver::ros_node
