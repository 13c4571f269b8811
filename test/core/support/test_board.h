#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

/// The other side of the lines, as the conformance tests of backends see it.
namespace stepdriver::test {

/// A level to which an output was driven.
struct Driven {
  std::string line;
  bool level;

  bool operator==(const Driven& other) const { return line == other.line && level == other.level; }
};

/// Two chips of eight lines for this test only.
class TestBoard {
 public:
  virtual ~TestBoard() = default;

  virtual gpio::Backend& backend() = 0;

  /// The name by which lines of chip 0 or 1 are requested.
  virtual std::string line(int chip, unsigned offset) const = 0;

  /// The level of an output that is requested.
  virtual bool level(const std::string& line) = 0;

  /// Drives an input. Edges may merge if they are closer than pace().
  virtual void drive(const std::string& line, bool level) = 0;
  virtual std::int64_t pace() const = 0;

  /// The clock of the times of edges.
  virtual std::int64_t now() const = 0;

  /// The levels to which outputs were driven since the last call, including those of the request,
  /// without repetitions. No value if the board can't tell.
  virtual std::optional<std::vector<Driven>> takeDriven() = 0;
};

/// A kind of board.
struct TestBoardKind {
  const char* name;
  std::string (*missing)();  ///< the reason why this machine can't have one; empty if it can
  std::unique_ptr<TestBoard> (*make)();
};

/// The name in GoogleTest's output.
inline void PrintTo(const TestBoardKind& kind, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << kind.name;
}

TestBoardKind simulatedBoard();
TestBoardKind gpioSimBoard();

}  // namespace stepdriver::test
