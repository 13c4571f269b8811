#pragma once

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "caught_output.h"
#include "keys.h"
#include "screen.h"

namespace stepdriver::console {

/// The terminal as a screen of rows, from the making to the end of this object, which gives it back
/// as it was. What the process prints meanwhile spoils no screen: printed() has it.
///
/// To be used by one thread; one at a time.
class Terminal {
 public:
  /// @throw Error where standard input or output is no terminal, or one that can't do it.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Waits for a key, but not longer than this.
  ///
  /// @return all that have come; none: the terminal has gone.
  std::optional<std::vector<Key>> keys(int milliseconds);
  int rows() const;
  int columns() const;
  void show(const std::vector<Row>& rows);
  /// Whole lines that the process has printed since the last time.
  std::vector<std::string> printed() { return output_->lines(); }

 private:
  std::unique_ptr<CaughtOutput> output_;
  std::FILE* tty_ = nullptr;
  void* screen_ = nullptr;  // as curses knows it; its header stays out of here
};

}  // namespace stepdriver::console
