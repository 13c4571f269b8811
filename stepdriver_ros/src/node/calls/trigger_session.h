#pragma once

#include <std_srvs/Trigger.h>

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace stepdriver::ros_node {

/// Carries out the calls of a service of the type std_srvs/Trigger, with the arguments of roscpp.
/// Must not throw.
using TriggerHandler =
    std::function<bool(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response)>;
/// The services by their full names.
using TriggerServices = std::map<std::string, TriggerHandler>;

/// The conversation with one client of Trigger services by TCPROS: a header from each side, then
/// requests and answers in turn. It takes and gives bytes, and uses no socket.
///
/// What the client sends before its turn stays in the socket, so a session never keeps more than a
/// part of one message.
class TriggerSession {
 public:
  /// @param services outlive the session.
  explicit TriggerSession(const TriggerServices& services) : services_(services) {}

  /// The number of bytes of the client that it can take now; 0: it isn't the client's turn.
  std::size_t wanted() const;
  /// Takes at most that many bytes, and carries out the requests that they complete.
  void receive(std::string_view bytes);

  /// The bytes that still have to be sent to the client.
  std::string_view output() const { return std::string_view(output_).substr(sent_); }
  /// This many bytes of the output have been sent.
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
