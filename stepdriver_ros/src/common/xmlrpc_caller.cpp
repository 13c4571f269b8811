#include "xmlrpc_caller.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <cerrno>
#include <memory>

#include "descriptor.h"

namespace stepdriver::ros_node {
namespace {

/// @return a connected socket, or none.
Descriptor connectTo(const addrinfo& address, std::chrono::milliseconds patience) {
  Descriptor socket(
      ::socket(address.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol));
  if (!socket) return socket;
  if (connect(socket.number(), address.ai_addr, address.ai_addrlen) == 0) return socket;
  if (errno != EINPROGRESS) return Descriptor();
  pollfd wait{socket.number(), POLLOUT, 0};
  int error = 0;
  socklen_t size = sizeof(error);
  const bool connected = poll(&wait, 1, static_cast<int>(patience.count())) == 1 &&
                         getsockopt(socket.number(), SOL_SOCKET, SO_ERROR, &error, &size) == 0 &&
                         error == 0;
  return connected ? std::move(socket) : Descriptor();
}

}  // namespace

XmlRpcCaller::XmlRpcCaller(const std::string& host, std::uint32_t port,
                           std::chrono::milliseconds patience)
    : XmlRpcClient(host.c_str(), static_cast<int>(port), "/"), patience_(patience) {}

// The base class's way writes each failure to the standard error output.
bool XmlRpcCaller::doConnect() {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(_host.c_str(), std::to_string(_port).c_str(), &hints, &found) != 0) return false;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, &freeaddrinfo);
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    Descriptor socket = connectTo(*address, patience_);
    if (!socket) continue;
    setfd(socket.release());
    return true;
  }
  return false;
}

std::optional<XmlRpcCaller::Answer> XmlRpcCaller::callWith(const char* method,
                                                           const XmlRpc::XmlRpcValue& arguments) {
  if (executeNonBlock(method, arguments)) {
    _disp.work(std::chrono::duration<double>(patience_).count());
  }
  XmlRpc::XmlRpcValue answer;
  if (_connectionState != IDLE || !parseResponse(answer) || isFault()) {
    close();
    return std::nullopt;
  }
  try {
    return Answer{static_cast<int>(answer[0]), static_cast<std::string>(answer[1]), answer[2]};
  } catch (const XmlRpc::XmlRpcException&) {
    return std::nullopt;  // Something else answers there.
  }
}

}  // namespace stepdriver::ros_node
