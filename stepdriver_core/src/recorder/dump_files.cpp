#include "dump_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "sim/vcd_trace.h"
#include "stepdriver_core/error.h"

namespace stepdriver::recorder {
namespace {

constexpr const char* kTraceEnd = ".vcd";
constexpr const char* kEventsEnd = ".txt";

[[noreturn]] void failed(const std::string& what, int error) {
  throw Error(fmt::format("the flight recorder can't write {}: {}", what, std::strerror(error)));
}

/// A folder that others can't read, unless it was there before.
void makeFolder(const std::string& path) {
  std::size_t end = 0;
  do {
    end = path.find('/', end + 1);
    const std::string part = path.substr(0, end);
    if (mkdir(part.c_str(), 0700) != 0 && errno != EEXIST) failed("the folder " + path, errno);
  } while (end != std::string::npos);
  struct stat facts {};
  if (stat(path.c_str(), &facts) != 0) failed("the folder " + path, errno);
  if (!S_ISDIR(facts.st_mode)) failed("the folder " + path, ENOTDIR);
}

static_assert(sizeof(timespec::tv_sec) >= 8, "32 bits of seconds end in 2038");
timespec wallTime() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return now;
}

std::string formatted(const timespec& time, const char* format) {
  tm parts{};
  gmtime_r(&time.tv_sec, &parts);
  char text[64];
  text[std::strftime(text, sizeof text, format, &parts)] = '\0';
  return text;
}

/// The names of recordings without their ends, by their numbers: the clock may have been set back.
using Recordings = std::map<std::uint64_t, std::string>;

/// `NAME_20260102-030405_17` has the number 17. @return empty if it isn't the name of a recording.
std::optional<std::uint64_t> numberOf(const std::string& name, const DumperOptions& options) {
  constexpr std::size_t kStamp = 15;
  const std::string begin = options.name + "_";
  const std::size_t number = begin.size() + kStamp + 1;
  if (name.rfind(begin, 0) != 0 || name.size() <= number || name.size() > number + 18) return {};
  std::string digits = name.substr(begin.size());
  if (digits[8] != '-' || digits[kStamp] != '_') return {};
  digits[8] = digits[kStamp] = '0';
  if (digits.find_first_not_of("0123456789") != std::string::npos) return {};
  return std::stoull(name.substr(number));
}

/// Those of this machine in the folder.
Recordings recordingsIn(const DumperOptions& options) {
  Recordings recordings;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(options.folder, error)) {
    const std::filesystem::path& path = entry.path();
    if (path.extension() != kTraceEnd && path.extension() != kEventsEnd) continue;
    const std::string name = path.stem().string();
    if (const auto number = numberOf(name, options)) recordings.emplace(*number, name);
  }
  if (error) failed("the folder " + options.folder, error.value());
  return recordings;
}

/// Makes room for another one.
void removeOldest(Recordings recordings, const DumperOptions& options) {
  for (; recordings.size() >= static_cast<std::size_t>(std::max(1, options.keep));
       recordings.erase(recordings.begin())) {
    for (const char* end : {kTraceEnd, kEventsEnd}) {
      const std::string path = options.folder + "/" + recordings.begin()->second + end;
      if (unlink(path.c_str()) != 0 && errno != ENOENT) failed(path, errno);
    }
  }
}

/// Files that are removed unless all went well.
class NewFiles {
 public:
  explicit NewFiles(const Dump& dump) : dump_(dump) {}
  ~NewFiles() {
    if (kept_) return;
    if (trace_made) unlink(dump_.trace.c_str());
    if (events_made) unlink(dump_.events.c_str());
  }
  NewFiles(const NewFiles&) = delete;
  NewFiles& operator=(const NewFiles&) = delete;
  void keep() { kept_ = true; }

  bool trace_made = false;
  bool events_made = false;

 private:
  const Dump& dump_;
  bool kept_ = false;
};

void writeTrace(const machine::Recording& recording, sim::VcdTrace& trace) {
  std::vector<sim::TracePin> pins;
  std::vector<bool> levels;
  std::vector<std::vector<int>> pins_of(recording.levels.size());
  for (const machine::Recording::Pin& pin : recording.pins) {
    const auto output = static_cast<std::size_t>(pin.output);
    pins_of[output].push_back(static_cast<int>(pins.size()));
    pins.push_back({pin.axis, pin.name, pin.active, pin.both_edges});
    levels.push_back(recording.levels[output]);
  }
  trace.begin(pins, levels, recording.begin);
  for (const machine::Recording::Edge& edge : recording.edges) {
    for (const int pin : pins_of[static_cast<std::size_t>(edge.output)]) {
      trace.edge(pin, edge.level, edge.time);
    }
  }
  trace.end(recording.end);
}

double seconds(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) * 1e-9; }

std::string eventsText(const machine::Recording& recording, const std::string& reason,
                       const std::string& trace, const timespec& wall) {
  std::string text = fmt::format(
      "stepdriver flight recorder\n"
      "reason:  {}\n"
      "written: {}.{:03} UTC\n"
      "trace:   {}\n"
      "holds:   {:.6f} s, {} edges{}\n"
      "time 0:  {:.9f} s of the machine's clock; the last line is the time of the recording\n"
      "\n",
      reason, formatted(wall, "%Y-%m-%d %H:%M:%S"), wall.tv_nsec / 1'000'000,
      trace.substr(trace.rfind('/') + 1), seconds(recording.end - recording.begin),
      recording.edges.size(), recording.shortened ? "; earlier ones didn't fit in the memory" : "",
      seconds(recording.begin));
  if (recording.events_lost) text += "earlier events didn't fit in the memory\n";
  for (const machine::Recording::Event& event : recording.events) {
    text += fmt::format("{:14.6f}  {}\n", seconds(event.time - recording.begin), event.text);
  }
  return text + fmt::format("{:14.6f}  recorded\n", seconds(recording.end - recording.begin));
}

void writeText(const std::string& path, const std::string& text, bool& made) {
  constexpr int kNew = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  const int file = open(path.c_str(), kNew, 0600);
  if (file < 0) failed(path, errno);
  made = true;
  int error = 0;
  for (std::size_t done = 0; done < text.size() && error == 0;) {
    const ssize_t count = write(file, text.data() + done, text.size() - done);
    if (count > 0) done += static_cast<std::size_t>(count);
    if (count < 0 && errno != EINTR) error = errno;
  }
  // Some file systems report a full disk here.
  if (close(file) != 0 && error == 0) error = errno;
  if (error != 0) failed(path, error);
}

}  // namespace

Dump writeFiles(const machine::Recording& recording, const std::string& reason,
                const DumperOptions& options) {
  makeFolder(options.folder);
  const Recordings earlier = recordingsIn(options);
  removeOldest(earlier, options);
  const timespec wall = wallTime();
  const std::uint64_t number = earlier.empty() ? 1 : earlier.rbegin()->first + 1;
  const std::string base = fmt::format("{}/{}_{}_{}", options.folder, options.name,
                                       formatted(wall, "%Y%m%d-%H%M%S"), number);
  Dump dump;
  dump.reason = reason;
  dump.trace = base + kTraceEnd;
  dump.events = base + kEventsEnd;
  NewFiles files(dump);
  {
    sim::VcdTrace trace(dump.trace, sim::VcdTrace::Replaces::kNoFile);
    files.trace_made = true;
    writeTrace(recording, trace);
  }
  writeText(dump.events, eventsText(recording, reason, dump.trace, wall), files.events_made);
  files.keep();
  return dump;
}

}  // namespace stepdriver::recorder
