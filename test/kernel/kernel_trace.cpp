#include "kernel_trace.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <istream>
#include <sstream>
#include <string_view>

#include "stepdriver_core/error.h"

namespace stepdriver::kernel {
namespace {

template <typename Number>
std::optional<Number> numberOf(const std::string& text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (text.empty() || error != std::errc() || stop != end) return std::nullopt;
  return number;
}

// Reads "12.345678" or "12.345678901", without the colon that follows.
std::optional<std::int64_t> nanosecondsOf(const std::string& text) {
  const std::size_t point = text.find('.');
  if (point == std::string::npos) return std::nullopt;
  std::string fraction = text.substr(point + 1);
  if (fraction.size() != 6 && fraction.size() != 9) return std::nullopt;
  fraction.resize(9, '0');
  const auto seconds = numberOf<std::int64_t>(text.substr(0, point));
  const auto nanoseconds = numberOf<std::int64_t>(fraction);
  if (!seconds || !nanoseconds || *nanoseconds < 0) return std::nullopt;
  return *seconds * 1'000'000'000 + *nanoseconds;
}

}  // namespace

KernelTrace::KernelTrace(std::istream& text, const std::string& name) {
  std::size_t number = 0;
  try {
    for (std::string line; std::getline(text, line);) {
      ++number;
      if (line.rfind("# chip ", 0) == 0) {
        readChip(line);
      } else if (line.find(" [LOST ") != std::string::npos) {
        throw Error("the kernel dropped events here: " + line);
      } else if (line.rfind('#', 0) != 0 && line.find(" gpio_value: ") != std::string::npos) {
        readEvent(line);
      }
    }
  } catch (const Error& error) {
    throw Error(name + ", line " + std::to_string(number) + ": " + error.what());
  }
}

KernelTrace KernelTrace::fromFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw Error("The trace " + path + " can't be read.");
  return KernelTrace(file, path);
}

void KernelTrace::readChip(const std::string& text) {
  // A label may contain blanks, but the two numbers after it don't.
  const std::string words = text.substr(std::string("# chip ").size());
  const std::size_t last = words.rfind(' ');
  const std::size_t middle = last == 0 ? std::string::npos : words.rfind(' ', last - 1);
  if (last == std::string::npos || middle == std::string::npos)
    throw Error("not a chip with its base and its lines: " + text);
  const auto base = numberOf<unsigned>(words.substr(middle + 1, last - middle - 1));
  const auto lines = numberOf<unsigned>(words.substr(last + 1));
  if (!base || !lines) throw Error("not a chip with its base and its lines: " + text);
  chips_[words.substr(0, middle)] = {*base, *lines};
}

// In "  program-37  [000] .....  1.717255808: gpio_value: 497 set 1" the program's name may contain
// blanks. So the event's name is found first, and the rest is read on both sides of it.
void KernelTrace::readEvent(const std::string& text) {
  constexpr std::string_view kEvent = ": gpio_value: ";
  const std::size_t event = text.rfind(kEvent);
  const std::size_t blank = event == std::string::npos ? event : text.rfind(' ', event);
  if (blank == std::string::npos) throw Error("not an event: " + text);
  const auto time_ns = nanosecondsOf(text.substr(blank + 1, event - blank - 1));
  std::istringstream words(text.substr(event + kEvent.size()));
  unsigned line = 0;
  std::string what;
  int level = -1;
  words >> line >> what >> level;
  if (!time_ns || !words || (what != "set" && what != "get") || level < 0 || level > 1)
    throw Error("not an event with its time, its line and its level: " + text);
  if (!events_.empty() && *time_ns < events_.back().time_ns)
    throw Error("the time goes back, so the trace's clock wasn't mono: " + text);
  events_.push_back({*time_ns, line, level == 1, what == "get"});
}

unsigned KernelTrace::line(const std::string& name) const {
  if (const auto number = numberOf<unsigned>(name)) return *number;
  const std::size_t colon = name.rfind(':');
  const auto offset =
      colon == std::string::npos ? std::nullopt : numberOf<unsigned>(name.substr(colon + 1));
  if (!offset) throw Error(name + " isn't a line: it is a number, or chip:offset.");
  const auto chip = chips_.find(name.substr(0, colon));
  if (chip == chips_.end()) {
    std::string known;
    for (const auto& [label, at] : chips_) known += (known.empty() ? "" : ", ") + label;
    throw Error("There is no chip for " + name + " in the trace; there is: " + known + ".");
  }
  if (*offset >= chip->second.lines)
    throw Error(name + ": the chip has " + std::to_string(chip->second.lines) + " lines.");
  return chip->second.base + *offset;
}

std::optional<bool> KernelTrace::firstLevel(unsigned line) const {
  for (const LineEvent& event : events_)
    if (event.line == line) return event.level;
  return std::nullopt;
}

std::vector<LineEdge> KernelTrace::edges(unsigned line) const {
  std::vector<LineEdge> edges;
  std::optional<bool> level;
  for (const LineEvent& event : events_) {
    if (event.line != line) continue;
    if (level && *level != event.level) edges.push_back({event.time_ns, event.level});
    level = event.level;
  }
  return edges;
}

std::vector<std::int64_t> KernelTrace::times(unsigned line, bool level) const {
  std::vector<std::int64_t> times;
  for (const LineEdge& edge : edges(line))
    if (edge.level == level) times.push_back(edge.time_ns);
  return times;
}

void copyTo(sim::PinTrace& trace, const KernelTrace& from, const std::vector<TracedPin>& pins) {
  std::vector<sim::TracePin> names;
  std::vector<bool> levels;
  std::map<unsigned, std::size_t> index;
  for (const TracedPin& traced : pins) {
    const std::string name = traced.pin.scope + "." + traced.pin.variable;
    const auto level = from.firstLevel(traced.line);
    if (!level)
      throw Error("Nothing happened to line " + std::to_string(traced.line) + " (" + name + ").");
    if (!index.emplace(traced.line, names.size()).second)
      throw Error("Line " + std::to_string(traced.line) + " (" + name + ") is asked for twice.");
    names.push_back(traced.pin);
    levels.push_back(*level);
  }

  const auto wanted = [&index](const LineEvent& event) { return index.count(event.line) != 0; };
  const auto& events = from.events();
  const auto first = std::find_if(events.begin(), events.end(), wanted);
  trace.begin(names, levels, first == events.end() ? 0 : first->time_ns);
  for (auto event = first; event != events.end(); ++event) {
    if (!wanted(*event)) continue;
    const std::size_t pin = index[event->line];
    if (levels[pin] == event->level) continue;
    levels[pin] = event->level;
    trace.edge(static_cast<int>(pin), event->level, event->time_ns);
  }
  trace.flush();
}

}  // namespace stepdriver::kernel
