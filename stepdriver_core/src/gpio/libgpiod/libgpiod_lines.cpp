#include "stepdriver_core/gpio/libgpiod_lines.h"

#include <fmt/format.h>

#include <cerrno>
#include <map>
#include <system_error>
#include <utility>

#include "gpiod_calls.h"
#include "held_lines.h"
#include "open_chips.h"
#include "stepdriver_core/error.h"

namespace stepdriver::gpio {
namespace {

using gpiod::HeldLines;

/// A request, from names to held lines.
class Requester {
 public:
  Requester(const std::vector<OutputRequest>& outputs, const std::vector<InputRequest>& inputs)
      : outputs_(outputs), inputs_(inputs), open_(gpiod::openChips()) {}

  std::unique_ptr<Lines> requestAll() {
    checkBias();
    addresses_ = findLines(open_.table, outputs_, inputs_);
    requestInputs();
    requestOutputs();
    keepNames();
    parts_.chips = std::move(open_.chips);
    return std::make_unique<HeldLines>(std::move(parts_));
  }

 private:
  /// Indices in the whole request, by chip.
  using ByChip = std::map<std::size_t, std::vector<std::size_t>>;

  ByChip byChip(const char* kind, std::size_t first, std::size_t count) const {
    ByChip found;
    for (std::size_t i = 0; i < count; ++i) found[addresses_[first + i].chip].push_back(i);
    for (const auto& [chip, members] : found) {
      if (members.size() <= gpiod::kMostLines) continue;
      throw GpioError(fmt::format(
          "{}: {} {} are requested, but the kernel allows at most {} of a chip in one request.",
          open_.table[chip].name, members.size(), kind, gpiod::kMostLines));
    }
    return found;
  }

  void checkBias() const {
    for (const InputRequest& input : inputs_) {
      if (input.bias == Bias::kAsIs || gpiod::canBias()) continue;
      throw GpioError(
          fmt::format("Line {}: libgpiod {} can't set a bias; 1.5 and later can. Fit a pull "
                      "resistor, and configure no bias.",
                      input.line, gpiod::version()));
    }
  }

  void requestInputs() {
    parts_.inputs.resize(inputs_.size());
    for (const auto& entry : byChip("inputs", outputs_.size(), inputs_.size())) {
      const std::size_t chip = entry.first;
      const std::vector<std::size_t>& members = entry.second;
      std::vector<gpiod::InputLine> lines;
      auto group = std::make_unique<gpiod::InputGroup>();
      for (const std::size_t i : members) {
        parts_.inputs[i] = {parts_.input_groups.size(), lines.size()};
        lines.push_back({addressOfInput(i).offset, inputs_[i].bias, inputs_[i].edges});
        group->inputs.push_back(static_cast<int>(i));
      }
      gpiod::Chip& from = *open_.chips[chip];
      request(
          chip, "inputs", lines,
          [&](const auto& some) { group->request = from.requestInputs(some); },
          [&](std::size_t k, int error) { return inputRefusal(members[k], error); });
      parts_.input_groups.push_back(std::move(group));
    }
  }

  void requestOutputs() {
    parts_.outputs.resize(outputs_.size());
    for (const auto& entry : byChip("outputs", 0, outputs_.size())) {
      const std::size_t chip = entry.first;
      const std::vector<std::size_t>& members = entry.second;
      std::vector<gpiod::OutputLine> lines;
      auto group = std::make_unique<gpiod::OutputGroup>();
      for (const std::size_t i : members) {
        const OutputRequest& output = outputs_[i];
        const gpiod::Seat seat{parts_.output_groups.size(), lines.size()};
        parts_.outputs[i] = {seat, output.safe_level, output.keep_on_release};
        if (output.safe_level) group->levels |= gpiod::bitOf(seat.index);
        lines.push_back({addresses_[i].offset, output.safe_level});
      }
      gpiod::Chip& from = *open_.chips[chip];
      request(
          chip, "outputs", lines,
          [&](const auto& some) { group->request = from.requestOutputs(some); },
          [&](std::size_t k, int error) { return outputRefusal(members[k], error); });
      parts_.output_groups.push_back(std::move(group));
    }
  }

  void keepNames() {
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      parts_.output_names.push_back(describe(open_.table, outputs_[i].line, addresses_[i]));
    }
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      parts_.input_names.push_back(describe(open_.table, inputs_[i].line, addressOfInput(i)));
    }
  }

  /// Requests lines of one chip. If that fails, it requests them one by one to find the one that
  /// failed, because the kernel doesn't report it.
  template <typename Line, typename RequestSome, typename Refusal>
  void request(std::size_t chip, const char* kind, const std::vector<Line>& lines,
               const RequestSome& request_some, const Refusal& refusal) {
    try {
      request_some(lines);
    } catch (const std::system_error& error) {
      for (std::size_t k = 0; k < lines.size(); ++k) {
        try {
          request_some(std::vector<Line>{lines[k]});
        } catch (const std::system_error& culprit) {
          throw GpioError(refusal(k, culprit.code().value()));
        }
      }
      throw GpioError(fmt::format("{}: its {} can't be requested together: {}: {}.",
                                  open_.table[chip].name, kind, error.what(),
                                  errorText(error.code().value())));
    }
  }

  LineAddress addressOfInput(std::size_t i) const { return addresses_[outputs_.size() + i]; }

  std::string inputRefusal(std::size_t i, int error) {
    const InputRequest& input = inputs_[i];
    std::string reason;
    if (error == EINVAL && input.bias != Bias::kAsIs) {
      reason =
          " The kernel supports a bias since Linux 5.5: fit a pull resistor, and configure no "
          "bias.";
    } else if (input.edges && (error == ENXIO || error == EINVAL || error == EIO)) {
      reason = " Perhaps this chip can't report edges: use a line of another chip.";
    }
    return refusal("input", input.line, addressOfInput(i), error, reason);
  }

  std::string outputRefusal(std::size_t i, int error) {
    std::string reason;
    if (error == EIO || error == EINVAL) {
      reason = " Perhaps this line can only be read: use another one.";
    }
    return refusal("output", outputs_[i].line, addresses_[i], error, reason);
  }

  std::string refusal(const char* kind, const std::string& line, LineAddress address, int error,
                      const std::string& reason) {
    const std::string described = "Line " + describe(open_.table, line, address);
    if (error == EBUSY) {
      // Another program requested it just now; the table doesn't know which.
      LineInfo holder;
      try {
        holder = open_.chips[address.chip]->info().lines[address.offset];
      } catch (const std::system_error&) {  // NOLINT(bugprone-empty-catch): then without a name
      }
      return described + busyText(holder);
    }
    return fmt::format("{} can't be requested as an {}: {}.{}{}", described, kind, errorText(error),
                       reason, remedyFor(error));
  }

  const std::vector<OutputRequest>& outputs_;
  const std::vector<InputRequest>& inputs_;
  gpiod::OpenChips open_;
  std::vector<LineAddress> addresses_;  // outputs first
  HeldLines::Parts parts_;              // after the chips: its lines must be released before them
};

class LibgpiodBackend : public Backend {
 public:
  std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                 const std::vector<InputRequest>& inputs) override {
    return Requester(outputs, inputs).requestAll();
  }
};

}  // namespace

std::string libgpiodVersion() { return gpiod::version(); }

std::unique_ptr<Backend> makeLibgpiodBackend() { return std::make_unique<LibgpiodBackend>(); }

std::vector<ChipInfo> gpioChips() { return gpiod::openChips().table; }

}  // namespace stepdriver::gpio
