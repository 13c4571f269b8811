#pragma once

#include <ros/datatypes.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/transport_hints.h>

#include <boost/function.hpp>
#include <boost/shared_ptr.hpp>
#include <boost/weak_ptr.hpp>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::ros_node {

/// Names of nodes by the topics that they publish.
using Publishers = std::map<std::string, std::vector<std::string>>;

/// The publishers of topics, and the addresses of their processes, according to the ROS master. Any
/// thread.
class PublisherDirectory {
 public:
  PublisherDirectory() = default;
  PublisherDirectory(const PublisherDirectory&) = delete;
  PublisherDirectory& operator=(const PublisherDirectory&) = delete;
  virtual ~PublisherDirectory() = default;

  /// @return no value: the master doesn't answer.
  virtual std::optional<Publishers> publishers() = 0;
  /// @return the address of a node's process; empty: the master doesn't know the node. No value:
  /// the
  ///   master doesn't answer.
  virtual std::optional<std::string> addressOf(const std::string& node) = 0;
};

/// Recognizes messages that were published before this node could receive them: nothing may move
/// because of a message that nobody has just sent.
///
/// A publisher that latches sends its last message to each new connection. The first message of
/// such a connection is old if the publisher was there before it: when this node began, when a
/// restarted master learned of this node again, or on an earlier connection. A publisher is a
/// process, so that a node which is started again under its name is a new one, and so is each
/// `rostopic pub`.
///
/// Such a publisher may also have latched nothing yet. Its first message looks the same, and counts
/// as old too.
///
/// Any thread may call isOld().
class LatchedMessages {
 public:
  /// The header of a connection, which roscpp keeps as long as the connection.
  using Connection = boost::shared_ptr<ros::M_string>;

  /// Asks who publishes what. Create it before the first subscription.
  ///
  /// @param directory outlives it.
  /// @throw Error if the master doesn't answer for ten seconds.
  explicit LatchedMessages(PublisherDirectory& directory);
  LatchedMessages(const LatchedMessages&) = delete;
  LatchedMessages& operator=(const LatchedMessages&) = delete;

  /// Call it before the topic is subscribed.
  ///
  /// @param topic its full name.
  void expect(const std::string& topic);

  /// Asks again who publishes the topics: those that are there now were there before what follows.
  /// Call it before this node registers with a restarted master.
  ///
  /// @return whether the master has answered.
  bool lookAgain();

  /// Judges a message of a topic; call it for each one. If it is old, the log says so.
  bool isOld(const std::string& topic, const Connection& connection);

 private:
  struct Publisher {
    /// The address of its process. Empty: it had ended when it was looked for. No value: it isn't
    /// known.
    std::optional<std::string> address;
    boost::weak_ptr<ros::M_string> connection;  // the last one
    std::uint64_t turn = 0;                     // when it was met last
  };
  using Known = std::map<std::string, Publisher>;  // The publishers by the names of their nodes

  void add(const std::string& topic, const Publishers& publishers);
  static void forgetOldest(Known& known);

  PublisherDirectory& directory_;
  Publishers at_begin_;
  std::mutex mutex_;
  std::map<std::string, Known> known_;  // those of each topic
  std::uint64_t turn_ = 0;
};

/// Subscribes to a topic whose messages move something: old ones are left out.
///
/// @param take is called with each message that isn't old.
/// @param latched outlives the subscriber.
template <typename M>
ros::Subscriber subscribeToNew(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue,
                               LatchedMessages& latched,
                               const boost::function<void(const boost::shared_ptr<const M>&)>& take,
                               const ros::TransportHints& hints = ros::TransportHints()) {
  using Event = ros::MessageEvent<const M>;
  const std::string name = node.resolveName(topic);
  latched.expect(name);
  const boost::function<void(const Event&)> take_new = [name, &latched, take](const Event& event) {
    if (!latched.isOld(name, event.getConnectionHeaderPtr())) take(event.getConstMessage());
  };
  return node.subscribe<const Event&>(topic, queue, take_new, ros::VoidConstPtr(), hints);
}

}  // namespace stepdriver::ros_node
