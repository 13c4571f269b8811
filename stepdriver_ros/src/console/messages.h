#pragma once

#include <cstddef>
#include <deque>
#include <string>

namespace stepdriver::console {

/// The latest messages, the newest last. A repeated message is kept once.
class Messages {
 public:
  static constexpr std::size_t kKept = 100;

  struct Message {
    std::string text;
    int times = 1;
  };

  void say(const std::string& text);

  const std::deque<Message>& all() const { return all_; }

 private:
  std::deque<Message> all_;
};

}  // namespace stepdriver::console
