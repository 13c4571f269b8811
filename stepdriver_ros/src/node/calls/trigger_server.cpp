#include "trigger_server.h"

#include <fcntl.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <ros/transport/transport_tcp.h>
#include <ros/xmlrpc_manager.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <iterator>
#include <optional>
#include <string_view>
#include <system_error>

#include "common/loopback_only.h"
#include "common/socket_address.h"

namespace stepdriver::ros_node {
namespace {

// No client is accepted for this long after the system lacked the resources for one.
constexpr std::chrono::milliseconds kAcceptPause{100};
constexpr auto kNever = std::chrono::steady_clock::time_point::max();
// What is polled: the wake-up, the listening socket, and then those of the connections.
constexpr std::size_t kListening = 1;
constexpr std::size_t kFirstConnection = 2;

[[noreturn]] void fail(const char* call) {
  throw std::system_error(errno, std::generic_category(), call);
}

Descriptor openReserve() { return Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)); }

Descriptor makeEvent() {
  Descriptor event(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!event) fail("eventfd");
  return event;
}

Descriptor listenAtAnyPort() {
  const bool only_localhost = onlyThisComputerMayCall();
  SocketAddress address{};
  socklen_t size = 0;
  if (ros::TransportTCP::s_use_ipv6_) {
    address.v6.sin6_family = AF_INET6;
    address.v6.sin6_addr = only_localhost ? in6addr_loopback : in6addr_any;
    size = sizeof(address.v6);
  } else {
    address.v4.sin_family = AF_INET;
    address.v4.sin_addr.s_addr = htonl(only_localhost ? INADDR_LOOPBACK : INADDR_ANY);
    size = sizeof(address.v4);
  }
  Descriptor listening(
      socket(address.any.sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!listening) fail("socket");
  if (bind(listening.number(), &address.any, size) != 0) fail("bind");
  if (listen(listening.number(), SOMAXCONN) != 0) fail("listen");
  return listening;
}

std::string uriOf(const Descriptor& listening) {
  return "rosrpc://" + ros::network::getHost() + ":" + std::to_string(portOf(listening.number()));
}

/// Tells the master of a service, or that it has ended.
void callMaster(const char* method, const std::string& service, const std::string& uri,
                const std::optional<std::string>& node_uri) {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue payload;
  request[0] = ros::this_node::getName();
  request[1] = service;
  request[2] = uri;
  if (node_uri) request[3] = *node_uri;
  // A node that starts waits for a missing master; a node that ends doesn't.
  if (!ros::master::execute(method, request, response, payload, node_uri.has_value())) {
    ROS_WARN_NAMED("node", "The master didn't accept %s for %s", method, service.c_str());
  }
}

/// Calls that end motions don't wait for a processor while the node plans. It is no loss if that
/// right isn't granted. Pulses have a higher priority.
void runBeforeOthers() {
  sched_param parameters{};
  parameters.sched_priority = sched_get_priority_min(SCHED_FIFO);
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

Descriptor acceptFrom(const Descriptor& listening) {
  Descriptor socket(accept4(listening.number(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  const int on = 1;
  if (socket) setsockopt(socket.number(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  return socket;
}

/// Another try at once would fail too.
bool isShortage(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

bool isPassing(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

TriggerServer::TriggerServer(std::string name)
    : name_(std::move(name)),
      reserve_(openReserve()),
      wake_(makeEvent()),
      listening_(listenAtAnyPort()),
      uri_(uriOf(listening_)) {}

void TriggerServer::advertise(const std::string& name, TriggerHandler handler) {
  services_.insert_or_assign(name, std::move(handler));
  callMaster("registerService", name, uri_, ros::XMLRPCManager::instance()->getServerURI());
}

void TriggerServer::start() {
  thread_ = std::thread([this] {
    pthread_setname_np(pthread_self(), name_.c_str());
    // Calls wait for the pulse thread in naps that are shorter than the default slack, 50 us.
    prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
    runBeforeOthers();
    serveAll();
  });
}

void TriggerServer::finish(std::chrono::milliseconds bound) {
  for (const auto& [name, handler] : services_) callMaster("unregisterService", name, uri_, {});
  if (thread_.joinable()) {
    finish_by_ = Clock::now() + bound;
    eventfd_write(wake_.number(), 1);
    thread_.join();
  }
  connections_.clear();
  listening_.close();
  services_.clear();
}

void TriggerServer::serveAll() {
  for (;;) {
    const Clock::time_point finish_by = finish_by_;
    const bool finishing = finish_by != kNever;
    Clock::time_point due = nextDue();
    if (finishing) {
      listening_.close();
      // Whatever idle clients have sent by now can be read at once.
      due = anyUnderWay() ? std::min(due, finish_by) : Clock::now();
    }
    const int ready = poll(finishing, due);
    const Clock::time_point now = Clock::now();
    if (finishing && (now >= finish_by || (ready == 0 && !anyUnderWay()))) return;
    serveConnections(now);
    if (polled_[kListening].revents != 0) accept();
  }
}

int TriggerServer::poll(bool finishing, Clock::time_point until) {
  const Clock::time_point now = Clock::now();
  polled_.clear();
  polled_.push_back({finishing ? -1 : wake_.number(), POLLIN, 0});
  polled_.push_back({now < accept_from_ ? -1 : listening_.number(), POLLIN, 0});
  for (const Connection& connection : connections_) {
    const bool answering = !connection.session.output().empty();
    polled_.push_back(
        {connection.socket.number(), static_cast<short>(answering ? POLLOUT : POLLIN), 0});
  }
  int timeout = -1;
  if (until != kNever) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - now);
    timeout = std::max(0, static_cast<int>(left.count()));
  }
  return ::poll(polled_.data(), polled_.size(), timeout);
}

TriggerServer::Clock::time_point TriggerServer::nextDue() const {
  Clock::time_point due = Clock::now() < accept_from_ ? accept_from_ : kNever;
  for (const Connection& connection : connections_) {
    if (!connection.session.isIdle()) due = std::min(due, connection.since + kPatience);
  }
  return due;
}

bool TriggerServer::anyUnderWay() const {
  return std::any_of(connections_.begin(), connections_.end(),
                     [](const Connection& connection) { return !connection.session.isIdle(); });
}

void TriggerServer::serveConnections(Clock::time_point now) {
  auto polled = polled_.begin() + kFirstConnection;
  for (auto connection = connections_.begin(); connection != connections_.end(); ++polled) {
    const bool stays = polled->revents != 0
                           ? connection->serve()
                           : connection->session.isIdle() || now - connection->since < kPatience;
    connection = stays ? std::next(connection) : connections_.erase(connection);
  }
}

bool TriggerServer::Connection::serve() { return receive() && !session.isBroken() && send(); }

bool TriggerServer::Connection::receive() {
  if (!session.output().empty()) return true;
  // When the conversation is over the client closes the connection. If the server did,
  // roscpp's clients could miss the answer (ros_comm issue 1976).
  const std::size_t wanted = session.wanted();
  std::array<char, 1024> buffer{};
  const ssize_t count =
      recv(socket.number(), buffer.data(), std::clamp<std::size_t>(wanted, 1, buffer.size()), 0);
  if (count < 0) return isPassing(errno);
  if (count == 0 || wanted == 0) return false;
  if (session.isIdle()) since = Clock::now();
  session.receive({buffer.data(), static_cast<std::size_t>(count)});
  return true;
}

bool TriggerServer::Connection::send() {
  const std::string_view output = session.output();
  if (output.empty()) return true;
  const ssize_t count = ::send(socket.number(), output.data(), output.size(), MSG_NOSIGNAL);
  if (count < 0) return isPassing(errno);
  session.sent(static_cast<std::size_t>(count));
  if (session.output().empty()) since = Clock::now();
  return true;
}

void TriggerServer::accept() {
  if (!reserve_) reserve_ = openReserve();
  if (connections_.size() >= kMostConnections) disconnectOne();
  Descriptor socket = acceptFrom(listening_);
  if (!socket && errno == EMFILE && makeRoom()) socket = acceptFrom(listening_);
  if (socket) {
    connections_.emplace_back(std::move(socket), services_);
  } else if (isShortage(errno)) {
    accept_from_ = Clock::now() + kAcceptPause;
  }
}

bool TriggerServer::makeRoom() {
  if (reserve_) {
    reserve_.close();
    return true;
  }
  if (connections_.empty()) return false;
  disconnectOne();
  return true;
}

void TriggerServer::disconnectOne() {
  const auto busy =
      std::count_if(connections_.begin(), connections_.end(),
                    [](const Connection& connection) { return !connection.session.isIdle(); });
  const bool lose_idle = static_cast<std::size_t>(2 * busy) <= connections_.size();
  auto longest_silent = connections_.end();
  for (auto one = connections_.begin(); one != connections_.end(); ++one) {
    if (one->session.isIdle() != lose_idle) continue;
    if (longest_silent == connections_.end() || one->since < longest_silent->since) {
      longest_silent = one;
    }
  }
  connections_.erase(longest_silent);
}

}  // namespace stepdriver::ros_node
