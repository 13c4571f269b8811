#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdint>

namespace stepdriver::ros_node {

/// An address of IPv4 or IPv6; `any.sa_family` says which.
union SocketAddress {
  sockaddr any;
  sockaddr_in v4;
  sockaddr_in6 v6;
};

/// @return the port of a socket's own end; 0: the descriptor has none, or is no socket.
inline std::uint16_t portOf(int descriptor) {
  SocketAddress address{};
  socklen_t size = sizeof(address);
  if (getsockname(descriptor, &address.any, &size) != 0) return 0;
  if (address.any.sa_family == AF_INET) return ntohs(address.v4.sin_port);
  if (address.any.sa_family == AF_INET6) return ntohs(address.v6.sin6_port);
  return 0;
}

}  // namespace stepdriver::ros_node
