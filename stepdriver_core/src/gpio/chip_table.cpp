#include "gpio/chip_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <iterator>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::gpio {
namespace {

struct ErrorWords {
  int error;
  const char* words;
};

/// The errors of GPIO calls; 524 is the kernel's own and has no name outside.
constexpr ErrorWords kErrors[] = {
    {EACCES, "EACCES, permission denied"},
    {EBUSY, "EBUSY, device or resource busy"},
    {EINVAL, "EINVAL, invalid argument"},
    {EIO, "EIO, input/output error"},
    {EMFILE, "EMFILE, too many open files"},
    {ENODEV, "ENODEV, no such device: the chip was removed"},
    {ENOMEM, "ENOMEM, out of memory"},
    {ENOTTY, "ENOTTY, the kernel doesn't know this call"},
    {ENXIO, "ENXIO, the line has no interrupt"},
    {EREMOTEIO, "EREMOTEIO, the firmware of the board has shut down"},
    {EPERM, "EPERM, operation not permitted"},
    {EPROTO, "EPROTO, the board hasn't made the steps that it was told"},
    {ETIME, "ETIME, the steps came too late for the board: the computer was busy for too long"},
    {ETIMEDOUT, "ETIMEDOUT, the chip doesn't answer"},
    {524, "ENOTSUPP, the chip's driver can't do this"},
};

/// The two halves of `chip:offset`.
struct Place {
  std::string chip;
  std::string offset;  // digits
};

/// Labels may have colons too: the last one counts.
std::optional<Place> placeIn(const std::string& line) {
  const auto colon = line.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == line.size()) return {};
  const std::string offset = line.substr(colon + 1);
  if (offset.find_first_not_of("0123456789") != std::string::npos) return {};
  return Place{line.substr(0, colon), offset};
}

/// Turns `a` into `a, b`.
void append(std::string& list, const std::string& word) {
  list += (list.empty() ? "" : ", ") + word;
}

std::string labelOf(const ChipInfo& chip) {
  return chip.label.empty() ? "no label" : '"' + chip.label + '"';
}

/// Lists the existing ones, and the chips that couldn't be read, because the line may be there.
std::string whatThereIs(const std::vector<ChipInfo>& chips) {
  if (chips.empty()) return " This machine has no GPIO chip (no /dev/gpiochip*).";
  std::string found;
  std::string hidden;
  for (const ChipInfo& chip : chips) {
    if (chip.error == 0) {
      append(found, fmt::format("{} ({}, {} lines)", chip.name, labelOf(chip), chip.lines.size()));
    } else {
      hidden += fmt::format(" {} couldn't be opened: {}.{}", chip.name, errorText(chip.error),
                            remedyFor(chip.error));
    }
  }
  return (found.empty() ? "" : " There are: " + found + ".") + hidden;
}

LineAddress lineOf(const std::vector<ChipInfo>& chips, std::size_t index, const std::string& line,
                   const std::string& digits) {
  const ChipInfo& chip = chips[index];
  const unsigned long offset = std::strtoul(digits.c_str(), nullptr, 10);
  if (chip.error != 0) {
    throw GpioError(fmt::format("Line {}: {} can't be opened: {}.{}", line, chip.name,
                                errorText(chip.error), remedyFor(chip.error)));
  }
  if (offset >= chip.lines.size()) {
    throw GpioError(
        fmt::format("Line {}: {} ({}) has {} lines, counted from 0: there is no line {}.", line,
                    chip.name, labelOf(chip), chip.lines.size(), digits));
  }
  return {index, static_cast<unsigned>(offset)};
}

/// The chips for which a predicate is true.
template <typename Predicate>
std::vector<std::size_t> chipsThat(const std::vector<ChipInfo>& chips, const Predicate& predicate) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < chips.size(); ++i) {
    if (predicate(chips[i])) found.push_back(i);
  }
  return found;
}

std::vector<LineAddress> linesNamed(const std::vector<ChipInfo>& chips, const std::string& name) {
  std::vector<LineAddress> found;
  for (std::size_t i = 0; i < chips.size(); ++i) {
    for (std::size_t offset = 0; offset < chips[i].lines.size(); ++offset) {
      if (chips[i].lines[offset].name == name) found.push_back({i, static_cast<unsigned>(offset)});
    }
  }
  return found;
}

}  // namespace

LineAddress findLine(const std::vector<ChipInfo>& chips, const std::string& line) {
  const auto place = placeIn(line);
  if (place) {
    auto found = chipsThat(chips, [&](const ChipInfo& chip) { return chip.name == place->chip; });
    if (found.empty()) {
      found = chipsThat(chips, [&](const ChipInfo& chip) { return chip.label == place->chip; });
    }
    if (found.size() == 1) return lineOf(chips, found.front(), line, place->offset);
    if (found.size() > 1) {
      std::string names;
      for (const std::size_t i : found) append(names, chips[i].name);
      throw GpioError(
          fmt::format("Line {}: several chips have the label {}: {}. Name the chip instead.", line,
                      place->chip, names));
    }
  }
  const auto found = linesNamed(chips, line);
  if (found.size() == 1) return found.front();
  if (found.size() > 1) {
    std::string places;
    for (const LineAddress& address : found) {
      append(places, fmt::format("{}:{}", chips[address.chip].name, address.offset));
    }
    throw GpioError(fmt::format(
        "Line {}: several lines have that name: {}. Name the one that is meant as chip:offset.",
        line, places));
  }
  if (place) {
    throw GpioError(fmt::format("Line {}: there is no chip with the name or label {}.{}", line,
                                place->chip, whatThereIs(chips)));
  }
  throw GpioError(
      fmt::format("Line {}: no chip has a line of that name.{} The command gpioinfo lists the "
                  "names of lines; chip:offset always works.",
                  line, whatThereIs(chips)));
}

std::vector<LineAddress> findLines(const std::vector<ChipInfo>& chips,
                                   const std::vector<OutputRequest>& outputs,
                                   const std::vector<InputRequest>& inputs) {
  std::vector<LineAddress> addresses;
  std::map<std::pair<std::size_t, unsigned>, std::string> taken;  // -> the name used
  const auto add = [&](const std::string& line) {
    const LineAddress address = findLine(chips, line);
    const auto twin = taken.emplace(std::make_pair(address.chip, address.offset), line);
    if (!twin.second) {
      throw GpioError(
          fmt::format("Line {} is named twice in one request, here and as {}. Each pin needs a "
                      "line of its own.",
                      describe(chips, line, address), twin.first->second));
    }
    addresses.push_back(address);
  };
  for (const OutputRequest& output : outputs) add(output.line);
  for (const InputRequest& input : inputs) add(input.line);

  std::size_t next = 0;
  const auto check = [&](const std::string& line) {
    const LineAddress address = addresses[next++];
    const LineInfo& info = chips[address.chip].lines[address.offset];
    if (info.used) throw GpioError("Line " + describe(chips, line, address) + busyText(info));
  };
  for (const OutputRequest& output : outputs) check(output.line);
  for (const InputRequest& input : inputs) check(input.line);
  return addresses;
}

std::string describe(const std::vector<ChipInfo>& chips, const std::string& line,
                     LineAddress address) {
  const ChipInfo& chip = chips[address.chip];
  const std::string place = fmt::format("{}:{}", chip.name, address.offset);
  const std::string& name = chip.lines[address.offset].name;
  std::string more;
  if (line != place) append(more, place);
  if (!chip.label.empty()) append(more, "chip " + labelOf(chip));
  if (!name.empty() && name != line) append(more, "line \"" + name + '"');
  return more.empty() ? line : fmt::format("{} ({})", line, more);
}

std::string busyText(const LineInfo& line) {
  if (line.consumer.empty()) {
    return fmt::format(
        " is busy ({}): it is held by the kernel, perhaps as a pin with another function. Name "
        "another line, or free it in the device tree (config.txt on a Raspberry Pi).",
        errorText(EBUSY));
  }
  return fmt::format(
      " is busy ({}): it is held by \"{}\". Stop that program or driver, or name another line.",
      errorText(EBUSY), line.consumer);
}

std::string errorText(int error) {
  const auto named = std::find_if(std::begin(kErrors), std::end(kErrors),
                                  [error](const ErrorWords& each) { return each.error == error; });
  if (named != std::end(kErrors)) return named->words;
  return fmt::format("errno {}, {}", error, std::generic_category().message(error));
}

std::string remedyFor(int error) {
  if (error != EACCES && error != EPERM) return "";
  return " Install config/udev/60-stepdriver-gpio.rules (it says how) and become a member of the "
         "group gpio: sudo usermod -aG gpio $USER, then log in again.";
}

}  // namespace stepdriver::gpio
