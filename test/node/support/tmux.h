#pragma once

#include <string>

#include "support/wait.h"

namespace stepdriver::node_test {

/// A shell in a terminal of its own, by a tmux server of its own; both end with this object.
class Tmux {
 public:
  Tmux(int columns, int rows);
  ~Tmux();
  Tmux(const Tmux&) = delete;
  Tmux& operator=(const Tmux&) = delete;

  /// Whether this machine has terminals: a root without /dev/pts has none.
  static bool possible();

  /// @param key a character, or what tmux calls a key: `Space`, `Enter`, `S-Right`.
  void press(const std::string& key) const;
  /// Types a line, with Enter at its end.
  void type(const std::string& line) const;
  void resize(int columns, int rows) const;
  /// What it shows.
  std::string screen() const;

  bool shows(const std::string& words) const { return screen().find(words) != std::string::npos; }
  /// Waits until it shows these words; if it doesn't, the test fails with what it shows.
  bool waitFor(const std::string& words) const;
  bool waitUntilGone(const std::string& words) const;

 private:
  std::string run(const std::string& arguments) const;

  const bool there_ = possible();
  std::string command_;
};

}  // namespace stepdriver::node_test
