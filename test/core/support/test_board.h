#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

/// What the conformance tests of backends see of the other side of the lines.
namespace stepdriver::test {

/// A level that an output was driven to.
struct Driven {
  std::string line;
  bool level;

  bool operator==(const Driven& other) const { return line == other.line && level == other.level; }
};

/// Two chips of eight lines that a test has for itself.
class TestBoard {
 public:
  virtual ~TestBoard() = default;

  virtual gpio::Backend& backend() = 0;

  /// The name for requests of a line of chip 0 or 1.
  virtual std::string line(int chip, unsigned offset) const = 0;

  /// The level of an output that is held.
  virtual bool level(const std::string& line) = 0;

  /// Drives an input. Edges may merge if they are closer than pace().
  virtual void drive(const std::string& line, bool level) = 0;
  virtual std::int64_t pace() const = 0;

  /// The clock that edges are stamped with.
  virtual std::int64_t now() const = 0;

  /// The levels that outputs were driven to since the last call, with those of their request, and
  /// without repetitions. None if the board can't tell.
  virtual std::optional<std::vector<Driven>> takeDriven() = 0;
};

/// A kind of board.
struct TestBoardKind {
  const char* name;
  std::string (*missing)();  ///< why there can't be one here; empty if there can
  std::unique_ptr<TestBoard> (*make)();
};

/// As GoogleTest shows it.
inline void PrintTo(const TestBoardKind& kind, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << kind.name;
}

TestBoardKind simulatedBoard();
TestBoardKind gpioSimBoard();

}  // namespace stepdriver::test
