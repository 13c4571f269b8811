#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "gpio/chip_table.h"
#include "stepdriver_core/gpio/lines.h"

/// The functions of libgpiod that the backend needs, independent of its version. gpiod1.cpp and
/// gpiod2.cpp implement them; one of the two is compiled. They only make the calls and decide
/// nothing.
///
/// Functions that request lines throw std::system_error with the errno. The others are noexcept and
/// don't allocate; only one thread at a time may call them on one object.
namespace stepdriver::gpio::gpiod {

constexpr const char* kConsumer = "stepdriver";

/// The limit of one request in both versions of the kernel's interface.
constexpr std::size_t kMostLines = 64;

/// A bit for each line of a request, by its index.
using LineBits = std::uint64_t;

inline LineBits bitOf(std::size_t line) { return LineBits{1} << line; }

struct OutputLine {
  unsigned offset;
  bool level;
};

struct InputLine {
  unsigned offset;
  Bias bias;
  bool edges;
};

/// The outputs of one chip. Lines are identified by their index in the request. Released on
/// destruction.
class Outputs {
 public:
  Outputs() = default;
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;
  virtual ~Outputs() = default;

  /// Drives lines, in one kernel call.
  ///
  /// @param lines a bit for each line that changes.
  /// @param levels a bit for each line of the request, because version 1 can only set all of them.
  /// @return 0 or the errno.
  virtual int set(LineBits lines, LineBits levels) noexcept = 0;
};

/// The inputs of one chip. Lines are identified by their index in the request. Released on
/// destruction.
class Inputs {
 public:
  Inputs() = default;
  Inputs(const Inputs&) = delete;
  Inputs& operator=(const Inputs&) = delete;
  virtual ~Inputs() = default;

  /// @return 0 or 1, or -errno; makes one kernel call.
  virtual int get(int line) noexcept = 0;

  /// The file descriptors that become readable when there are edges.
  virtual const std::vector<int>& edgeFds() const = 0;

  /// Reads at least one edge from the fd of this index, which must be readable.
  ///
  /// @param edges their `input` is the index of the line here.
  /// @return the number of edges, or -errno.
  virtual int takeEdges(std::size_t fd, EdgeEvent* edges, std::size_t capacity) noexcept = 0;
};

class Chip {
 public:
  Chip() = default;
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;
  virtual ~Chip() = default;

  /// The current state of the chip and its lines.
  virtual ChipInfo info() = 0;

  /// Requests at most kMostLines lines. The chip must outlive them.
  virtual std::unique_ptr<Outputs> requestOutputs(const std::vector<OutputLine>& lines) = 0;
  virtual std::unique_ptr<Inputs> requestInputs(const std::vector<InputLine>& lines) = 0;
};

std::unique_ptr<Chip> openChip(const std::string& path);

/// Whether an input's bias can be set: since version 1.5.
bool canBias();

/// `1.6.3`.
std::string version();

}  // namespace stepdriver::gpio::gpiod
