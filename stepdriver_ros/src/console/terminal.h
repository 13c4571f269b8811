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

/// The terminal as a screen of rows. The destructor restores the terminal. Output of the process
/// doesn't disturb the screen meanwhile: printed() returns it.
///
/// One thread uses it, and there is only one object at a time.
class Terminal {
 public:
  /// @throw Error if standard input or output is no terminal, or an unsuitable one.
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Waits for a key for at most this time.
  ///
  /// @return all keys so far; nullopt: the terminal has gone.
  std::optional<std::vector<Key>> keys(int milliseconds);
  int rows() const;
  int columns() const;
  void show(const std::vector<Row>& rows);
  /// Whole lines that the process has printed since the last call.
  std::vector<std::string> printed() { return output_->lines(); }

 private:
  std::unique_ptr<CaughtOutput> output_;
  std::FILE* tty_ = nullptr;
  void* screen_ = nullptr;  // a curses type, whose header stays out of here
};

}  // namespace stepdriver::console
