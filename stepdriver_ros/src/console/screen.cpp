#include "screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "axis_table.h"
#include "common/io_words.h"
#include "wrapped.h"

namespace stepdriver::console {
namespace {

constexpr int kFewestMessages = 3;  // rows of messages that the help leaves free

std::string secondsText(double seconds) { return fmt::format("{:.1f} s", seconds); }

std::vector<Row> rowsOf(const std::string& text, int columns, bool loud = false) {
  std::vector<Row> rows;
  for (const std::string& line : wrapped(text, columns)) rows.push_back({line, loud});
  return rows;
}

void append(std::vector<Row>& rows, const std::vector<Row>& more) {
  rows.insert(rows.end(), more.begin(), more.end());
}

Row titleRow(const Session& session, int columns, double now) {
  const auto age = session.driver().age(now);
  const bool live = session.driver().live(now);
  const std::string state = live  ? "live"
                            : age ? "NO STATE FOR " + secondsText(*age) + ": values are old"
                                  : "NO STATE YET";
  std::string text = "stepdriver console  " + session.driverName();
  const auto width = static_cast<std::size_t>(columns);
  if (text.size() + 2 + state.size() > width) text = session.driverName();
  if (text.size() + 2 + state.size() > width) return {state.substr(0, width), !live};
  text += std::string(width - text.size() - state.size(), ' ') + state;
  return {text, !live};
}

std::vector<Row> emergencyRows(const Session& session, int columns, double now) {
  switch (session.emergency()) {
    case Session::Emergency::kNone:
      return {};
    case Session::Emergency::kSent:
      return rowsOf(
          fmt::format(
              "*** EMERGENCY STOP sent {} ago, NO ANSWER YET: be ready to cut the power ***",
              secondsText(now - session.emergencySince())),
          columns, true);
    case Session::Emergency::kFailed:
      return rowsOf(fmt::format("*** EMERGENCY STOP FAILED: {}. CUT THE POWER BY HAND ***",
                                session.emergencyMessage()),
                    columns, true);
    case Session::Emergency::kStopped:
      break;
  }
  std::vector<Row> rows =
      rowsOf("*** EMERGENCY STOP: the driver has stopped every axis ***", columns, true);
  append(rows,
         rowsOf("    Motors keep their current. When all is safe, r recovers; that moves nothing.",
                columns, true));
  return rows;
}

/// The remaining rows of the window, handed out in the order of importance.
class Body {
 public:
  explicit Body(int room) : room_(std::max(room, 0)) {}

  int left() const { return room_; }
  /// @return the rows for which there is room.
  std::vector<Row> fit(std::vector<Row> rows) {
    if (static_cast<int>(rows.size()) > room_) rows.resize(room_);
    room_ -= static_cast<int>(rows.size());
    return rows;
  }
  std::vector<Row> fitWhole(std::vector<Row> rows, int but_leave = 0) {
    if (static_cast<int>(rows.size()) + but_leave > room_) return {};
    return fit(std::move(rows));
  }

 private:
  int room_;
};

/// The axes that fit, around the chosen one, and the number of those that don't.
std::vector<Row> axisRows(const AxisTable& table, Body& body) {
  const int count = static_cast<int>(table.rows.size());
  if (count <= body.left() || body.left() < 1) return body.fit(table.rows);
  const int fit = std::max(body.left() - 1, 1);
  const int first = std::clamp(table.chosen - fit / 2, 0, count - fit);
  std::vector<Row> rows(table.rows.begin() + first, table.rows.begin() + first + fit);
  rows.push_back(
      {fmt::format("axes {} to {} of {}; up, down: the others", first + 1, first + fit, count),
       false});
  return body.fit(rows);
}

std::vector<Row> faultRows(const Session& session, int columns) {
  std::vector<Row> rows;
  for (const AxisView& axis : session.driver().axes()) {
    if (!axis.fault.empty()) {
      append(rows, rowsOf(fmt::format("FAULT {}: {}", axis.name, axis.fault), columns, true));
    }
  }
  const bool told = session.emergency() == Session::Emergency::kStopped;
  if (!rows.empty() && !told) append(rows, rowsOf("  r recovers: it ends the faults", columns));
  return rows;
}

std::vector<Row> hiddenRows(const AxisTable& table, int columns) {
  if (table.hidden.empty()) return {};
  std::string text = "too narrow to show:";
  for (const std::string& title : table.hidden) {
    text += (&title == &table.hidden.front() ? " " : ", ") + title;
  }
  return rowsOf(text, columns);
}

std::vector<Row> pendingRows(const Session& session, int columns, double now) {
  std::vector<Row> rows;
  for (const Session::PendingCall& pending : session.pending()) {
    const double since = now - pending.since;
    if (since < 0.5) continue;
    append(rows,
           rowsOf(fmt::format("... {}: under way for {}", pending.call.name(), secondsText(since)),
                  columns));
  }
  return rows;
}

/// What the next keys will do: the step size and the override. And how the chosen axis's driver is.
std::vector<Row> settingRows(const Session& session, int columns) {
  const auto factor = session.speedOverride();
  const config::AxisConfig* config = session.driver().config(session.chosen());
  const std::string unit = config == nullptr ? "mm" : configUnitOf(config->kind);
  std::vector<Row> rows =
      rowsOf(fmt::format("- + steps: {}    speed override: {}", session.stepSize().text(unit),
                         factor ? fmt::format("{:.0f} %", *factor * 100.0) : "unknown"),
             columns);
  if (const std::string chips = session.driver().chipsOf(session.chosen()); !chips.empty()) {
    append(rows, rowsOf("driver: " + chips, columns));
  }
  return rows;
}

/// As many of the texts in each row as fit.
std::vector<Row> packed(const std::vector<std::string>& texts, int columns) {
  const std::string gap(4, ' ');
  std::vector<Row> rows;
  std::string line;
  for (const std::string& text : texts) {
    if (line.size() + gap.size() + text.size() > static_cast<std::size_t>(columns)) {
      if (!line.empty()) append(rows, rowsOf(line, columns));
      line.clear();
    }
    line += (line.empty() ? "" : gap) + text;
  }
  append(rows, rowsOf(line, columns));
  return rows;
}

std::string ageText(const std::optional<double>& changed, double now) {
  if (!changed) return "since the start";
  const double age = std::max(now - *changed, 0.0);
  if (age < 60.0) return fmt::format("{:.0f} s", std::floor(age));
  if (age < 3600.0) return fmt::format("{:.0f} min", std::floor(age / 60.0));
  return fmt::format("{:.0f} h", std::floor(age / 3600.0));
}

/// The outputs and inputs with a name: "> pen: on 3 s" is the output that `t` switches. Old states
/// are in brackets.
std::vector<Row> ioRows(const Session& session, int columns, double now) {
  const DriverView& driver = session.driver();
  const bool live = driver.live(now);
  const auto text = [&](const std::string& name, const std::string& state, const auto& changed) {
    return fmt::format(live ? "{}: {} {}" : "{}: [{} {}]", shortName(name, kShortName), state,
                       ageText(changed, now));
  };
  std::vector<Row> rows;
  const OutputView* const chosen = session.chosenOutput();
  std::vector<std::string> texts{"outputs"};
  for (const OutputView& output : driver.outputs()) {
    std::string shown =
        (output.name == chosen->name ? "> " : "") +
        text(output.name, ros_node::outputWords(output.on, output.value), output.changed);
    if (!output.axis.empty()) {
      shown += fmt::format(", by {}: {} made, {} missed", shortName(output.axis, kShortName),
                           output.compared, output.missed);
    }
    texts.push_back(std::move(shown));
  }
  if (texts.size() > 1) append(rows, packed(texts, columns));
  texts = {"inputs"};
  for (const InputView& input : driver.inputs()) {
    texts.push_back(text(input.name, input.active ? "active" : "inactive", input.changed));
  }
  if (texts.size() > 1) append(rows, packed(texts, columns));
  for (const OutputView& output : driver.outputs()) {
    if (!output.note.empty()) append(rows, rowsOf(output.name + ": " + output.note, columns));
    if (output.error.empty()) continue;
    append(rows, rowsOf("OUTPUT " + output.name + ": " + output.error, columns, true));
  }
  for (const InputView& input : driver.inputs()) {
    if (input.error.empty()) continue;
    append(rows, rowsOf("INPUT " + input.name + ": " + input.error, columns, true));
  }
  return rows;
}

std::vector<Row> promptRows(const Session& session, int columns) {
  if (const auto& axis = session.zeroAsked()) {
    return rowsOf(fmt::format("Set the position of {} to 0? Its soft limits then count from here. "
                              "(y yes, any other key no)",
                              shortName(*axis, kShortName)),
                  columns, true);
  }
  if (const ClosedPrompt* const closed = session.closedPrompt()) {
    return rowsOf(fmt::format("{} isn't moved: {} nothing until Enter or Esc (s, SPACE stop)",
                              shortName(closed->axis, kShortName),
                              closed->typed ? "keys do" : "the keys of a number do"),
                  columns, true);
  }
  const PositionPrompt* const prompt = session.prompt();
  if (prompt == nullptr) return {};
  const config::AxisConfig* config = session.driver().config(prompt->axis());
  return rowsOf(fmt::format("Move {} to [{}]: {}_    (Enter moves it, Esc cancels, s stops)",
                            shortName(prompt->axis(), kShortName),
                            config == nullptr ? "?" : configUnitOf(config->kind), prompt->text()),
                columns, true);
}

std::vector<Row> helpRows(const Session& session, int columns) {
  const std::string axis =
      session.chosen().empty() ? "the axis" : shortName(session.chosen(), kShortName);
  std::vector<std::string> texts = {"up down 1-9 choose an axis",
                                    "e enable " + axis,
                                    "d disable " + axis,
                                    "left right jog slowly while held",
                                    "shift+left shift+right < > jog fast",
                                    "- + one step",
                                    "i step size",
                                    "g go to a position",
                                    "z set zero",
                                    "h home " + axis,
                                    "a home all",
                                    "m o all motors on, off",
                                    "p hold all",
                                    "c resume",
                                    "[ ] speed",
                                    "r recover"};
  if (const OutputView* const output = session.chosenOutput()) {
    const std::string name = shortName(output->name, kShortName);
    texts.push_back("n next output");
    // The driver refuses to switch an output that a position switches.
    texts.push_back(output->axis.empty() ? "t switch " + name : "u no longer by position: " + name);
  }
  std::vector<Row> rows = packed(texts, columns);
  if (!session.showsHelp()) return rows;
  append(rows,
         packed({", . jog slowly too", "k j tab choose an axis too", "= one step too"}, columns));
  for (const char* line :
       {"A jog ends 0.2 s after the last key; keys held repeat by themselves.",
        "- is towards min, + towards max. s and Esc decelerate, SPACE doesn't.",
        "i: one motor step, 0.1, 1 or 10 mm or deg. z: this place is 0, after a y.",
        "p pauses all motions until c. [ ] slow down or speed up all by 10 %.",
        "r ends faults and an emergency stop, and moves nothing."}) {
    append(rows, rowsOf(line, columns));
  }
  return rows;
}

/// The short help leaves room for messages. The whole help, which the user has asked for, leaves
/// room for a single message, and is cut if it doesn't fit.
std::vector<Row> takeHelp(const Session& session, int columns, Body& body) {
  constexpr int kLines = 2;  // those of '-' above the messages and above the help
  std::vector<Row> rows = helpRows(session, columns);
  if (!session.showsHelp()) return body.fitWhole(std::move(rows), kFewestMessages + kLines);
  const int room = body.left() - kLines - 1;
  if (room < 1) return {};
  if (static_cast<int>(rows.size()) > room) {
    rows.resize(room);
    rows.back() = Row{std::string("...more keys in a larger window").substr(0, columns), false};
  }
  return body.fit(std::move(rows));
}

std::vector<Row> messageRows(const Session& session, int columns, int room) {
  std::vector<Row> rows;
  const auto& all = session.messages().all();
  for (auto message = all.rbegin(); message != all.rend(); ++message) {
    const std::string times = message->times > 1 ? fmt::format(" ({} times)", message->times) : "";
    const std::vector<Row> lines = rowsOf(message->text + times, columns);
    if (static_cast<int>(rows.size() + lines.size()) > room) {
      // At least the beginning of the newest message is shown.
      if (rows.empty()) rows.assign(lines.begin(), lines.begin() + room);
      break;
    }
    rows.insert(rows.begin(), lines.begin(), lines.end());
  }
  return rows;
}

Row keyRow(int columns) {
  static const std::vector<std::string> texts = {
      "SPACE EMERGENCY STOP    s stop all axes    q quit    ? all keys",
      "SPACE EMERGENCY STOP  s stop  q quit", "SPACE EMERG. STOP", "SPACE STOP"};
  for (const std::string& text : texts) {
    if (static_cast<int>(text.size()) <= columns) return {text, true};
  }
  return {texts.back().substr(0, columns), true};
}

}  // namespace

std::vector<Row> draw(const Session& session, int rows, int columns, double now) {
  std::vector<Row> screen = emergencyRows(session, columns, now);
  if (static_cast<int>(screen.size()) >= rows) {
    screen.resize(rows);
    return screen;
  }
  Body body(rows - static_cast<int>(screen.size()) - 1);  // except the row of keys
  append(screen, body.fit({titleRow(session, columns, now)}));
  const AxisTable table = axisTable(session, columns, now);
  const std::vector<Row> axes = axisRows(table, body);
  const std::vector<Row> prompt = body.fit(promptRows(session, columns));
  const std::vector<Row> faults = body.fit(faultRows(session, columns));
  const std::vector<Row> hidden = body.fit(hiddenRows(table, columns));
  const std::vector<Row> titles = body.fit({table.titles});
  const std::vector<Row> pending = body.fit(pendingRows(session, columns, now));
  const std::vector<Row> settings = body.fitWhole(settingRows(session, columns), 1);
  const std::vector<Row> io = body.fitWhole(ioRows(session, columns, now), 1);
  std::vector<Row> help = takeHelp(session, columns, body);
  if (!help.empty()) {
    help.insert(help.begin(), Row{std::string(columns, '-'), false});
    body.fit({Row{}});
  }
  std::vector<Row> messages = body.fitWhole({{std::string(columns, '-'), false}}, 1);
  append(messages, messageRows(session, columns, body.left()));

  append(screen, titles);
  append(screen, axes);
  append(screen, hidden);
  append(screen, faults);
  append(screen, settings);
  append(screen, io);
  append(screen, prompt);
  append(screen, messages);
  append(screen, pending);
  // The keys stay at the bottom, regardless of the messages.
  const int below = static_cast<int>(help.size()) + 1;
  screen.resize(std::max<int>(static_cast<int>(screen.size()), rows - below));
  append(screen, help);
  screen.push_back(keyRow(columns));
  for (Row& row : screen) row.text = row.text.substr(0, columns);
  return screen;
}

}  // namespace stepdriver::console
