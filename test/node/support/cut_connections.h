#pragma once

#include <netinet/in.h>
#include <ros/connection_manager.h>
#include <sys/resource.h>
#include <sys/socket.h>

namespace stepdriver::node_test {

/// Ends all connections that subscribers have made to this process. roscpp's subscribers connect
/// again.
inline void cutConnections() {
  const auto own = ros::ConnectionManager::instance()->getTCPPort();
  rlimit numbers{};
  getrlimit(RLIMIT_NOFILE, &numbers);
  for (int number = 0; number < static_cast<int>(numbers.rlim_cur); ++number) {
    sockaddr_in near{};
    sockaddr_in far{};
    socklen_t near_size = sizeof near;
    socklen_t far_size = sizeof far;
    if (getsockname(number, reinterpret_cast<sockaddr*>(&near), &near_size) != 0 ||
        getpeername(number, reinterpret_cast<sockaddr*>(&far), &far_size) != 0) {
      continue;  // It is no connection.
    }
    if (near.sin_family == AF_INET && ntohs(near.sin_port) == own) shutdown(number, SHUT_RDWR);
  }
}

}  // namespace stepdriver::node_test
