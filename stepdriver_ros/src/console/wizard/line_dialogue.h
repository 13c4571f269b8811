#pragma once

#include <functional>
#include <string>

#include "common/end_requests.h"
#include "dialogue.h"

namespace stepdriver::console {

/// A dialogue on standard input and output, with or without a terminal. Signals that ask the
/// program to end, the end of the input, and a line `q` end it.
class LineDialogue : public Dialogue {
 public:
  /// @param meanwhile called often while waiting for a line.
  LineDialogue(ros_node::EndRequests& end_requests, std::function<void()> meanwhile)
      : end_requests_(end_requests), meanwhile_(std::move(meanwhile)) {}

  void say(const std::string& text) override;
  std::string ask(const std::string& question) override;
  std::optional<std::string> line() override;
  std::optional<std::string> lineOfAHand() override;

 private:
  void read();

  ros_node::EndRequests& end_requests_;
  const std::function<void()> meanwhile_;
  std::string unread_;
  bool closed_ = false;
};

}  // namespace stepdriver::console
