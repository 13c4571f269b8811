#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <queue>
#include <stdexcept>
#include <string>
#include <tuple>

#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::driver {
namespace {

constexpr std::size_t kPins = std::tuple_size<ModeCode>::value;
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
    throw std::invalid_argument(
        fmt::format("The {} has no microstep pin code for {} microsteps.", chip.title, microsteps));
  }
  return indexOf(*code);
}

}  // namespace

std::vector<ModeCode> modePath(const DriverChip& chip, int from_microsteps, int to_microsteps) {
  const std::size_t from = indexOfMode(chip, from_microsteps);
  const std::size_t to = indexOfMode(chip, to_microsteps);

  // Breadth first from the goal, so that following `next` from the start is a shortest way.
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

  if (next[from] == kUnseen) {
    throw std::invalid_argument(
        fmt::format("The {} has no way from {} to {} microsteps over defined pin codes.",
                    chip.title, from_microsteps, to_microsteps));
  }
  std::vector<ModeCode> path;
  for (std::size_t code = from; code != to; code = next[code]) path.push_back(codeAt(next[code]));
  return path;
}

}  // namespace stepdriver::driver
