#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/chip_table.h"
#include "stepdriver_core/gpio/lines.h"

/// What the backend needs of libgpiod, in the words of neither of its versions. gpiod1.cpp and
/// gpiod2.cpp are two forms of it, of which one is compiled; they call, and decide nothing.
///
/// What is called when lines are requested throws std::system_error with the errno; the rest is
/// noexcept, doesn't allocate, and isn't safe to call on one object from two threads at a time.
namespace stepdriver::gpio::gpiod {

constexpr const char* kConsumer = "stepdriver";

/// What both versions of the kernel's interface take in one request.
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

/// The outputs of one chip. Lines go by their index in the request. Released on destruction.
class Outputs {
 public:
  Outputs() = default;
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;
  virtual ~Outputs() = default;

  /// Drives lines, in one call of the kernel.
  ///
  /// @param lines a bit for each line that changes.
  /// @param levels a bit for each line of all, since version 1 can only set all of a request.
  /// @return 0 or the errno.
  virtual int set(LineBits lines, LineBits levels) noexcept = 0;
};

/// The inputs of one chip. Lines go by their index in the request. Released on destruction.
class Inputs {
 public:
  Inputs() = default;
  Inputs(const Inputs&) = delete;
  Inputs& operator=(const Inputs&) = delete;
  virtual ~Inputs() = default;

  /// @return 0 or 1, or -errno; one call of the kernel.
  virtual int get(int line) noexcept = 0;

  /// Readable when there are edges.
  virtual const std::vector<int>& edgeFds() const = 0;

  /// Reads from the fd of this index, which must be readable, at least one edge.
  ///
  /// @param edges their `input` is the index of the line here.
  /// @return how many, or -errno.
  virtual int takeEdges(std::size_t fd, EdgeEvent* edges, std::size_t capacity) noexcept = 0;
};

class Chip {
 public:
  Chip() = default;
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;
  virtual ~Chip() = default;

  /// The chip and its lines as they are now.
  virtual ChipInfo info() = 0;

  /// At most kMostLines. The chip must outlive them.
  virtual std::unique_ptr<Outputs> requestOutputs(const std::vector<OutputLine>& lines) = 0;
  virtual std::unique_ptr<Inputs> requestInputs(const std::vector<InputLine>& lines) = 0;
};

std::unique_ptr<Chip> openChip(const std::string& path);

/// Whether an input's bias can be set: from version 1.5 on.
bool canBias();

/// `1.6.3`.
std::string version();

}  // namespace stepdriver::gpio::gpiod
