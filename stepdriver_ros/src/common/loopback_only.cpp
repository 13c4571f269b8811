#include "loopback_only.h"

#include <ros/console.h>
#include <ros/network.h>
#include <ros/transport/transport_tcp.h>
#include <ros/xmlrpc_manager.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "common/socket_address.h"

namespace stepdriver::ros_node {
namespace {

constexpr char kLoopback[] = "lo";
constexpr int kNoSocket = -1;

/// Asks roscpp, which reads the environment in its own way.
class Transport : public ros::TransportTCP {
 public:
  Transport() : TransportTCP(nullptr) {}
  bool isOnlyLocal() const { return isOnlyLocalhostAllowed(); }
};

bool listensOn(int socket, std::uint16_t port) {
  int listens = 0;
  socklen_t size = sizeof(listens);
  if (getsockopt(socket, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0 || listens == 0) {
    return false;
  }
  return portOf(socket) == port;
}

/// The socket of roscpp's XML-RPC server. roscpp doesn't tell it, only its port.
int xmlRpcSocket(std::uint16_t port) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const int number = std::atoi(entry.path().filename().c_str());
    if (listensOn(number, port)) return number;
  }
  return kNoSocket;
}

bool isLoopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.compare(0, 4, "127.") == 0;
}

void warnOfMixedAddresses(bool only_local) {
  const std::string& host = ros::network::getHost();
  if (only_local && !isLoopback(host)) {
    ROS_WARN_NAMED(
        "node",
        "This node listens on 127.0.0.1, because of ROS_IP, but tells others the address "
        "%s, because of ROS_HOSTNAME: nobody may reach it. Set only one of them",
        host.c_str());
  } else if (!only_local && isLoopback(host)) {
    ROS_WARN_NAMED("node",
                   "This node tells others the address %s, but listens on every address: other "
                   "computers can reach it. Set ROS_IP=127.0.0.1 to prevent that",
                   host.c_str());
  }
}

}  // namespace

bool onlyThisComputerMayCall() { return Transport().isOnlyLocal(); }

void closeToOtherComputers() {
  const bool only_local = onlyThisComputerMayCall();
  warnOfMixedAddresses(only_local);
  if (!only_local) return;
  const auto port = static_cast<std::uint16_t>(ros::XMLRPCManager::instance()->getServerPort());
  const int socket = xmlRpcSocket(port);
  // A bound socket keeps its address, but it can be tied to an interface.
  if (setsockopt(socket, SOL_SOCKET, SO_BINDTODEVICE, kLoopback, sizeof(kLoopback)) == 0) return;
  ROS_WARN_NAMED(
      "node",
      "Other computers can reach the XML-RPC port %u of this node and end it, in spite of "
      "ROS_IP: SO_BINDTODEVICE %s failed (%s). docs/security.md shows how to close it",
      static_cast<unsigned>(port), kLoopback, std::strerror(errno));
}

}  // namespace stepdriver::ros_node
