#pragma once

#include <string>

#include "support/wait.h"

namespace stepdriver::node_test {

/// A shell in its own terminal, on its own tmux server; both end with this object.
class Tmux {
 public:
  Tmux(int columns, int rows);
  ~Tmux();
  Tmux(const Tmux&) = delete;
  Tmux& operator=(const Tmux&) = delete;

  /// Whether this machine has terminals: a chroot without /dev/pts doesn't.
  static bool possible();

  /// @param key a character, or tmux's name of a key: `Space`, `Enter`, `S-Right`.
  void press(const std::string& key) const;
  /// Types a line, with Enter at its end.
  void type(const std::string& line) const;
  void resize(int columns, int rows) const;
  /// The text on the terminal.
  std::string screen() const;

  bool shows(const std::string& words) const { return screen().find(words) != std::string::npos; }
  /// Waits until the terminal shows these words; otherwise the test fails with the terminal's text.
  bool waitFor(const std::string& words) const;
  bool waitUntilGone(const std::string& words) const;

 private:
  std::string run(const std::string& arguments) const;

  const bool there_ = possible();
  std::string command_;
};

}  // namespace stepdriver::node_test
