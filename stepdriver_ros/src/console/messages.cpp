#include "messages.h"

namespace stepdriver::console {

void Messages::say(const std::string& text) {
  if (!all_.empty() && all_.back().text == text) {
    ++all_.back().times;
    return;
  }
  all_.push_back({text, 1});
  if (all_.size() > kKept) all_.pop_front();
}

}  // namespace stepdriver::console
