#include "tcpros.h"

namespace stepdriver::ros_node {

std::uint32_t readLength(std::string_view bytes) {
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < kLengthBytes; ++i) {
    length |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
  }
  return length;
}

std::string lengthBytes(std::size_t length) {
  std::string bytes;
  for (std::size_t i = 0; i < kLengthBytes; ++i) {
    bytes += static_cast<char>((length >> (8 * i)) & 0xFFU);
  }
  return bytes;
}

std::optional<ConnectionHeader> readHeader(std::string_view bytes) {
  ConnectionHeader header;
  while (!bytes.empty()) {
    if (bytes.size() < kLengthBytes) return {};
    const std::size_t length = readLength(bytes);
    bytes.remove_prefix(kLengthBytes);
    if (length > bytes.size()) return {};
    const std::string_view field = bytes.substr(0, length);
    bytes.remove_prefix(length);
    const std::size_t equals = field.find('=');
    if (equals == std::string_view::npos) return {};
    header.emplace(field.substr(0, equals), field.substr(equals + 1));
  }
  return header;
}

std::string headerBytes(const ConnectionHeader& header) {
  std::string fields;
  for (const auto& [name, value] : header) {
    fields += lengthBytes(name.size() + 1 + value.size());
    fields += name;
    fields += '=';
    fields += value;
  }
  return lengthBytes(fields.size()) + fields;
}

}  // namespace stepdriver::ros_node
