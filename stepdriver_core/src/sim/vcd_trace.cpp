#include "sim/vcd_trace.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::sim {
namespace {

constexpr std::size_t kBufferSize = 65'536;
constexpr std::int64_t kTailNs = 1'000;
// The beginning of every trace, by which a file is recognised as one.
constexpr std::string_view kTitle = "$version stepdriver $end\n";

// Letters only: the format allows any printable character, but readers trip over `#` and `$`.
std::string identifierOf(std::size_t index) {
  static constexpr char kLetters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
  constexpr std::size_t kBase = sizeof kLetters - 1;
  std::string identifier;
  do {
    identifier += kLetters[index % kBase];
    index /= kBase;
  } while (index != 0);
  return identifier;
}

// A name in a VCD file ends at the first blank, and sigrok-cli's options at `:`, `=` and `,`.
std::string wordOf(const std::string& name) {
  std::string word;
  for (const char c : name) word += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return word;
}

[[noreturn]] void cannotBeWritten(const std::string& path) {
  throw Error(fmt::format("the trace file {} can't be written: {}", path, std::strerror(errno)));
}

[[noreturn]] void isNoTrace(const std::string& path) {
  throw Error(fmt::format(
      "the trace file {} exists and isn't a trace of the simulated rig: give another name, or set "
      "simulation/trace_overwrites_any_file to overwrite it",
      path));
}

bool isTraceOrEmpty(int file) {
  char beginning[kTitle.size()];
  const ssize_t count = pread(file, beginning, sizeof beginning, 0);
  return count == 0 || (count == static_cast<ssize_t>(sizeof beginning) &&
                        std::string_view(beginning, sizeof beginning) == kTitle);
}

/// Opens it and makes it empty. Doesn't wait for a reader of a pipe.
int openForTrace(const std::string& path, VcdTrace::Replaces replaces) {
  if (replaces == VcdTrace::Replaces::kNoFile) {
    constexpr int kNew = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
    const int file = open(path.c_str(), kNew, 0600);
    if (file < 0) cannotBeWritten(path);
    return file;
  }
  const bool any = replaces == VcdTrace::Replaces::kAnyFile;
  struct stat facts {};
  // Even opening can do something to a device.
  if (!any && stat(path.c_str(), &facts) == 0 && !S_ISREG(facts.st_mode)) isNoTrace(path);
  const int flags = (any ? O_WRONLY : O_RDWR) | O_CREAT | O_NONBLOCK | O_CLOEXEC;
  const int file = open(path.c_str(), flags, 0666);
  if (file < 0 || fstat(file, &facts) != 0) cannotBeWritten(path);
  const bool regular = S_ISREG(facts.st_mode);
  if (!any && !isTraceOrEmpty(file)) {
    close(file);
    isNoTrace(path);
  }
  if ((regular && ftruncate(file, 0) != 0) || fcntl(file, F_SETFL, 0) != 0) {
    const int error = errno;
    close(file);
    errno = error;
    cannotBeWritten(path);
  }
  return file;
}

}  // namespace

VcdTrace::VcdTrace(std::string path, Replaces replaces)
    : path_(std::move(path)), file_(openForTrace(path_, replaces)) {
  buffer_.reserve(2 * kBufferSize);
}

VcdTrace::~VcdTrace() {
  if (begun_) stamp(last_ns_ + kTailNs);
  writeOut();
  close(file_);
}

void VcdTrace::begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
                     std::int64_t time_ns) {
  begun_ = true;
  start_ns_ = last_ns_ = time_ns;
  buffer_ += kTitle;
  buffer_ += "$timescale 1 ns $end\n";
  for (std::size_t i = 0; i < pins.size(); ++i) {
    ids_.push_back(identifierOf(i));
    const bool first = i == 0 || pins[i].scope != pins[i - 1].scope;
    if (first && i != 0) buffer_ += "$upscope $end\n";
    if (first) buffer_ += "$scope module " + wordOf(pins[i].scope) + " $end\n";
    const std::string variable = wordOf(pins[i].variable);
    buffer_ += "$var wire 1 " + ids_[i] + ' ' + variable + " $end\n";
  }
  if (!pins.empty()) buffer_ += "$upscope $end\n";
  for (const TracePin& pin : pins) {
    if (!pin.active && !pin.both_edges) continue;
    buffer_ += "$comment " + wordOf(pin.scope) + '.' + wordOf(pin.variable) + " active ";
    buffer_ += pin.both_edges ? "both $end\n" : *pin.active ? "high $end\n" : "low $end\n";
  }
  buffer_ += "$enddefinitions $end\n#0\n$dumpvars\n";
  for (std::size_t i = 0; i < pins.size(); ++i) buffer_ += (levels[i] ? '1' : '0') + ids_[i] + '\n';
  buffer_ += "$end\n";
}

void VcdTrace::edge(int pin, bool level, std::int64_t time_ns) {
  if (time_ns != last_ns_) stamp(time_ns);
  last_ns_ = time_ns;
  buffer_ += level ? '1' : '0';
  buffer_ += ids_[static_cast<std::size_t>(pin)];
  buffer_ += '\n';
  if (buffer_.size() >= kBufferSize) writeOut();
}

void VcdTrace::summary(const std::string& text) { buffer_ += "$comment " + text + " $end\n"; }

void VcdTrace::flush() {
  writeOut();
  if (!error_.empty()) throw Error(error_);
}

void VcdTrace::end(std::int64_t time_ns) {
  if (begun_ && time_ns > last_ns_) stamp(time_ns);
  begun_ = false;
  flush();
}

void VcdTrace::stamp(std::int64_t time_ns) {
  char text[24] = {'#'};
  char* const end = std::to_chars(text + 1, text + sizeof text - 1, time_ns - start_ns_).ptr;
  *end = '\n';
  buffer_.append(text, end + 1);
}

void VcdTrace::writeOut() {
  std::size_t done = 0;
  while (error_.empty() && done < buffer_.size()) {
    const ssize_t count = write(file_, buffer_.data() + done, buffer_.size() - done);
    if (count > 0) done += static_cast<std::size_t>(count);
    if (count >= 0 || errno == EINTR) continue;
    error_ = fmt::format("the trace file {} is incomplete, because it couldn't be written: {}",
                         path_, std::strerror(errno));
    // Half a time stamp would be another time.
    if (ftruncate(file_, static_cast<off_t>(written_)) != 0 && errno != EINVAL) {
      error_ += fmt::format("; its last line may be wrong: {}", std::strerror(errno));
    }
  }
  written_ += done;
  buffer_.clear();
}

}  // namespace stepdriver::sim
