#pragma once

#include <poll.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <list>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/descriptor.h"
#include "trigger_session.h"

namespace stepdriver::ros_node {

/// Serves services of the type std_srvs/Trigger with a socket and a thread of its own. Clients see
/// no difference, but no long message delays their calls: roscpp reads all connections of a node
/// in one thread.
///
/// Calls are carried out one after another. A slow, silent or hostile client delays no other: a
/// client never has more memory than a header takes, it must finish what it begins in time, and if
/// there are too many clients, one is disconnected. Clients that wait for their next call lose no
/// place to those who never finish a header.
///
/// To be used by one thread.
class TriggerServer {
 public:
  /// How many clients can be connected at once.
  static constexpr std::size_t kMostConnections = 256;
  /// How long a client may take to send a header, to send the rest of a request, and to read an
  /// answer.
  static constexpr std::chrono::seconds kPatience{10};

  /// @param name of the thread, up to 15 characters.
  /// @throw std::system_error if there is no socket for it.
  explicit TriggerServer(std::string name);
  ~TriggerServer() { finish(std::chrono::milliseconds(0)); }
  TriggerServer(const TriggerServer&) = delete;
  TriggerServer& operator=(const TriggerServer&) = delete;

  /// Tells the master of a service, before start(). Until then its calls wait.
  ///
  /// @param name the full name.
  /// @param handler is called by the thread, until finish().
  void advertise(const std::string& name, TriggerHandler handler);

  void start();

  /// Takes no new clients, answers the calls that have come, and ends the thread.
  ///
  /// @param bound for clients that don't read their answers or don't stop asking.
  void finish(std::chrono::milliseconds bound);

 private:
  using Clock = std::chrono::steady_clock;

  struct Connection {
    Connection(Descriptor its_socket, const TriggerServices& services)
        : socket(std::move(its_socket)), session(services) {}

    /// Receives and sends as much as possible now.
    /// @return false if the connection must be closed.
    bool serve();
    bool receive();
    bool send();

    Descriptor socket;
    TriggerSession session;
    Clock::time_point since = Clock::now();  ///< last beginning or end of something by the client
  };

  void serveAll();
  /// Waits until at least one of polled_ is ready.
  /// @return how many are ready.
  int poll(bool finishing, Clock::time_point until);
  /// When something is due even if nothing arrives.
  Clock::time_point nextDue() const;
  bool anyUnderWay() const;
  void serveConnections(Clock::time_point now);
  void accept();
  bool makeRoom();
  /// If one has to be closed, the larger of the two groups, idle clients and others, loses the one
  /// that has been silent for the longest time.
  void disconnectOne();

  const std::string name_;
  Descriptor reserve_;  ///< lets a client in when the process has no other descriptor left
  Descriptor wake_;     ///< an eventfd
  Descriptor listening_;
  const std::string uri_;
  TriggerServices services_;
  std::atomic<Clock::time_point> finish_by_{Clock::time_point::max()};
  std::thread thread_;

  // Used only by the thread.
  std::list<Connection> connections_;
  std::vector<pollfd> polled_;
  Clock::time_point accept_from_;
};

}  // namespace stepdriver::ros_node
