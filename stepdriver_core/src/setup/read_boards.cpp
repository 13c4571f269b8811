#include "setup/read_boards.h"

#include <algorithm>
#include <cctype>

namespace stepdriver::setup {
namespace {

using config::Range;

// Below, a computer that is busy for a moment has no steps on the board; beyond, a stop begins
// late.
constexpr Range kAheadsMs = {20.0, 500.0};
constexpr Range kStepErrorsUs = {0.0, 25.0};
constexpr int kLowestBaud = 9'600;
constexpr int kHighestBaud = 4'000'000;

bool isBoardName(const std::string& name) {
  return std::isalpha(static_cast<unsigned char>(name[0])) != 0 &&
         std::all_of(name.begin(), name.end(), [](unsigned char letter) {
           return std::isalnum(letter) != 0 || letter == '_';
         });
}

}  // namespace

std::vector<BoardConfig> readBoards(config::ConfigReader boards) {
  std::vector<BoardConfig> read;
  for (const std::string& name : boards.keys()) {
    config::ConfigReader reader = boards.map(name);
    if (name.empty() || !isBoardName(name)) {
      boards.issue(name,
                   "is no name of a board: it must begin with a letter and have letters, "
                   "digits and _ only");
      continue;
    }
    BoardConfig board;
    board.name = name;
    board.port = reader.text("port");
    board.baud = reader.integer("baud", kLowestBaud, kHighestBaud, board.baud);
    board.ahead = 1e-3 * reader.number("ahead_ms", kAheadsMs, board.ahead * 1e3);
    board.step_error = 1e-6 * reader.number("step_error_us", kStepErrorsUs, 0.0);
    board.reset = reader.boolean("reset", board.reset);
    reader.rejectUnknown();
    read.push_back(board);
  }
  return read;
}

}  // namespace stepdriver::setup
