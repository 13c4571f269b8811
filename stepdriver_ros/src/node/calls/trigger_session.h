#pragma once

#include <std_srvs/Trigger.h>

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace stepdriver::ros_node {

/// What carries out the calls of a service of the type std_srvs/Trigger, as roscpp calls it. It
/// must not throw.
using TriggerHandler =
    std::function<bool(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response)>;
/// By the full names of the services.
using TriggerServices = std::map<std::string, TriggerHandler>;

/// The conversation with one client of Trigger services by TCPROS: a header from each side, then
/// requests and answers in turn. It takes and gives bytes, and knows nothing of sockets.
///
/// What the client sends before it is its turn again is left in the socket, so a session never
/// keeps more than a part of one message.
class TriggerSession {
 public:
  /// @param services outlive the session.
  explicit TriggerSession(const TriggerServices& services) : services_(services) {}

  /// How many bytes of the client it can take now. 0: it is not the client's turn.
  std::size_t wanted() const;
  /// Takes bytes, no more than it wants. Carries out what they complete.
  void receive(std::string_view bytes);

  /// What is still to be sent to the client.
  std::string_view output() const { return std::string_view(output_).substr(sent_); }
  /// So many bytes of the output have been sent.
  void sent(std::size_t bytes) { sent_ += bytes; }

  /// The client may take any time until its next request.
  bool isIdle() const;
  /// The client broke the rules: it gets no answer.
  bool isBroken() const { return stage_ == Stage::kBroken; }

 private:
  enum class Stage {
    kHeaderLength,
    kHeader,
    kRequest,
    kOver,  ///< nothing follows the output; the client closes the connection
    kBroken
  };

  void answerHeader(std::string_view bytes);
  void refuse(const std::string& why);
  void serve();
  void say(std::string bytes);

  const TriggerServices& services_;
  TriggerServices::const_iterator service_;
  Stage stage_ = Stage::kHeaderLength;
  std::size_t header_length_ = 0;
  bool persistent_ = false;
  std::string input_;
  std::string output_;
  std::size_t sent_ = 0;
};

}  // namespace stepdriver::ros_node
