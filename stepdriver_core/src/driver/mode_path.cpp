#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <queue>
#include <string>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"

namespace stepdriver::driver {
namespace {

constexpr std::size_t kPins = kMostModePins;
constexpr std::size_t kCodes = std::size_t{1} << kPins;
constexpr std::size_t kUnseen = kCodes;

std::size_t indexOf(const ModeCode& code) {
  std::size_t index = 0;
  for (std::size_t pin = 0; pin < kPins; ++pin) {
    if (code[pin]) index |= std::size_t{1} << pin;
  }
  return index;
}

ModeCode codeAt(std::size_t index) {
  ModeCode code{};
  for (std::size_t pin = 0; pin < kPins; ++pin) code[pin] = (index >> pin & 1U) != 0;
  return code;
}

std::size_t indexOfMode(const DriverChip& chip, int microsteps) {
  const std::optional<ModeCode> code = codeOf(chip, microsteps);
  if (!code) {
    throw Error(
        fmt::format("the {} has no microstep pin code for {} microsteps", chip.title, microsteps));
  }
  return indexOf(*code);
}

/// The next code on a shortest way to a mode, for each code; kUnseen: there is no way.
std::array<std::size_t, kCodes> waysTo(const DriverChip& chip, std::size_t to) {
  std::array<std::size_t, kCodes> next;
  next.fill(kUnseen);
  next[to] = to;
  std::queue<std::size_t> open;
  open.push(to);
  while (!open.empty()) {
    const std::size_t code = open.front();
    open.pop();
    for (std::size_t pin = 0; pin < kPins; ++pin) {
      const std::size_t neighbour = code ^ (std::size_t{1} << pin);
      if (next[neighbour] != kUnseen || !microstepsOf(chip, codeAt(neighbour))) continue;
      next[neighbour] = code;
      open.push(neighbour);
    }
  }
  return next;
}

}  // namespace

bool hasModePath(const DriverChip& chip, int from_microsteps, int to_microsteps) {
  const std::size_t from = indexOfMode(chip, from_microsteps);
  return waysTo(chip, indexOfMode(chip, to_microsteps))[from] != kUnseen;
}

std::vector<ModeCode> modePath(const DriverChip& chip, int from_microsteps, int to_microsteps) {
  const std::size_t from = indexOfMode(chip, from_microsteps);
  const std::size_t to = indexOfMode(chip, to_microsteps);
  const std::array<std::size_t, kCodes> next = waysTo(chip, to);
  if (next[from] == kUnseen) {
    throw Error(fmt::format("the {} has no way from {} to {} microsteps over defined pin codes",
                            chip.title, from_microsteps, to_microsteps));
  }
  std::vector<ModeCode> path;
  for (std::size_t code = from; code != to; code = next[code]) path.push_back(codeAt(next[code]));
  return path;
}

}  // namespace stepdriver::driver
