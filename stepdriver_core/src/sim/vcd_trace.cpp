#include "sim/vcd_trace.h"

#include <cctype>
#include <charconv>
#include <cstddef>

#include "stepdriver_core/error.h"

namespace stepdriver::sim {
namespace {

constexpr std::size_t kBufferSize = 65'536;
constexpr std::int64_t kTailNs = 1'000;

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

}  // namespace

VcdTrace::VcdTrace(const std::string& path) : path_(path), file_(path, std::ios::trunc) {
  if (!file_) throw Error("The trace file " + path + " can't be written.");
  buffer_.reserve(2 * kBufferSize);
}

VcdTrace::~VcdTrace() {
  if (begun_) stamp(last_ns_ + kTailNs);
  writeOut();
}

void VcdTrace::begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
                     std::int64_t time_ns) {
  begun_ = true;
  start_ns_ = last_ns_ = time_ns;
  buffer_ += "$version stepdriver $end\n$timescale 1 ns $end\n";
  for (std::size_t i = 0; i < pins.size(); ++i) {
    ids_.push_back(identifierOf(i));
    const bool first = i == 0 || pins[i].scope != pins[i - 1].scope;
    if (first && i != 0) buffer_ += "$upscope $end\n";
    if (first) buffer_ += "$scope module " + wordOf(pins[i].scope) + " $end\n";
    const std::string variable = wordOf(pins[i].variable);
    buffer_ += "$var wire 1 " + ids_[i] + ' ' + variable + " $end\n";
  }
  if (!pins.empty()) buffer_ += "$upscope $end\n";
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

void VcdTrace::flush() {
  writeOut();
  file_.flush();
  if (!file_) throw Error("The trace file " + path_ + " couldn't be written: it is incomplete.");
}

void VcdTrace::stamp(std::int64_t time_ns) {
  char text[24] = {'#'};
  char* const end = std::to_chars(text + 1, text + sizeof text - 1, time_ns - start_ns_).ptr;
  *end = '\n';
  buffer_.append(text, end + 1);
}

void VcdTrace::writeOut() {
  file_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  buffer_.clear();
}

}  // namespace stepdriver::sim
