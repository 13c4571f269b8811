#include "terminal.h"

#include <fmt/format.h>

// Without this, curses would define its functions as macros, which would rename the functions of
// others.
#define NCURSES_NOMACROS
#include <curses.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <map>

#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

// For bytes of one key that arrive separately, for example over a slow line.
constexpr int kEscapeDelay = 100;  // [ms]

Key keyOf(int code) {
  static const std::map<int, Key> keys = {
      {KEY_UP, kKeyUp},       {KEY_DOWN, kKeyDown},       {KEY_LEFT, kKeyLeft},
      {KEY_RIGHT, kKeyRight}, {KEY_SLEFT, kKeyShiftLeft}, {KEY_SRIGHT, kKeyShiftRight},
      {KEY_ENTER, kKeyEnter}, {'\r', kKeyEnter},          {KEY_BACKSPACE, kKeyBackspace},
      {'\b', kKeyBackspace},
  };
  const auto found = keys.find(code);
  return found == keys.end() ? code : found->second;
}

/// Whether the current terminal of curses can move its cursor.
bool movesItsCursor() {
  char name[] = "cup";
  return tigetstr(name) != nullptr;
}

}  // namespace

Terminal::Terminal() {
  if (isatty(STDIN_FILENO) == 0 || isatty(STDOUT_FILENO) == 0) {
    throw Error("standard input and output must be a terminal (over ssh: ssh -t)");
  }
  auto output = std::make_unique<CaughtOutput>();
  tty_ = fdopen(dup(output->realOutput()), "w");
  SCREEN* const curses = tty_ == nullptr ? nullptr : newterm(nullptr, tty_, stdin);
  if (curses == nullptr || !movesItsCursor()) {
    if (curses != nullptr) {
      endwin();
      delscreen(curses);
    }
    if (tty_ != nullptr) std::fclose(tty_);
    const char* const type = std::getenv("TERM");
    throw Error(fmt::format("this terminal can't show a screen: TERM is {}; --wizard needs none",
                            type == nullptr ? "not set" : type));
  }
  output_ = std::move(output);
  screen_ = curses;
  raw();  // no key is a signal, none stops the output
  noecho();
  keypad(stdscr, TRUE);
  nodelay(stdscr, TRUE);
  set_escdelay(kEscapeDelay);
  curs_set(0);
}

Terminal::~Terminal() {
  endwin();
  delscreen(static_cast<SCREEN*>(screen_));
  std::fclose(tty_);
}

std::optional<std::vector<Key>> Terminal::keys(int milliseconds) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  poll(&input, 1, milliseconds);
  if ((input.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) return {};
  std::vector<Key> keys;
  bool swallowed = false;
  for (int code = getch(); code != ERR; code = getch()) {
    if (!swallowed && code != KEY_RESIZE) keys.push_back(keyOf(code));
    // The following bytes belong to an unknown key.
    swallowed = swallowed || code == kKeyEscape;
  }
  return keys;
}

int Terminal::rows() const { return getmaxy(stdscr); }

int Terminal::columns() const { return getmaxx(stdscr); }

void Terminal::show(const std::vector<Row>& rows) {
  erase();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    attrset(rows[i].loud ? A_BOLD | A_REVERSE : A_NORMAL);
    mvaddnstr(static_cast<int>(i), 0, rows[i].text.c_str(), columns());
  }
  attrset(A_NORMAL);
  refresh();
}

}  // namespace stepdriver::console
