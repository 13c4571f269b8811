#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "registrations.h"
#include "xmlrpc_caller.h"

namespace stepdriver::ros_node {

/// Asks the ROS master each second for a service of this node, and registers all topics and
/// services again with a master that has forgotten them, because it was restarted or was told so:
/// roscpp registers only once, and without that no new client would find anything of the node. If a
/// newer node has taken this one's name, nothing is registered again: the name is that one's.
class MasterWatch {
 public:
  /// What is called by start(), and then in the watch's thread.
  struct Events {
    std::function<void()> lost;   ///< the master no longer answers
    std::function<void()> found;  ///< it answers again
    /// Before this node registers with a master that has forgotten it. False: it must be called
    /// again a second later.
    std::function<bool()> forgotten;
    std::function<void(const Registrations&)> registered;  ///< with that master
  };

  /// @param service of this node, by its full name.
  MasterWatch(std::string service, Events events);
  ~MasterWatch();
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  /// Asks the master what is registered, and begins to watch it. Call it once everything is
  /// advertised.
  void start();
  /// Waits at most for the answer to the current call, a second.
  void stop();

  struct Reading {
    std::string uri;
    double silent = 0.0;  ///< [s] since when it hasn't answered; 0: it answers
    int restarts = 0;     ///< how many times the node has registered again
  };
  /// Any thread.
  Reading reading() const;

 private:
  using Clock = std::chrono::steady_clock;

  void watch();
  void look();
  void lose();
  void find();
  /// Whether the master knows another node of this one's name. No value: it doesn't answer.
  std::optional<bool> hasAnotherNode();
  void registerAgain();

  const std::string service_;
  const Events events_;
  XmlRpcCaller master_;
  // For start(), and then for the watch's thread only.
  std::optional<Registrations> registrations_;
  bool registered_ = true;

  mutable std::mutex mutex_;
  std::condition_variable end_;
  bool ending_ = false;
  std::optional<Clock::time_point> lost_;
  int restarts_ = 0;
  std::thread thread_;
};

/// Events that a node logs.
///
/// @param lost is called once that is logged.
/// @param forgotten as in MasterWatch::Events.
MasterWatch::Events loggedEvents(const std::function<void()>& lost,
                                 const std::function<bool()>& forgotten);

}  // namespace stepdriver::ros_node
