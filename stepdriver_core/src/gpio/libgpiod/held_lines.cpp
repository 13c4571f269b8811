#include "held_lines.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <mutex>
#include <utility>

#include "gpio/chip_table.h"
#include "steady_now.h"
#include "stepdriver_core/error.h"

namespace stepdriver::gpio::gpiod {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

template <typename Items>
bool has(const Items& items, int index) {
  return index >= 0 && static_cast<std::size_t>(index) < items.size();
}

int setLevels(OutputGroup& group, LineBits lines, LineBits levels) noexcept {
  const std::lock_guard<PriorityMutex> lock(group.mutex);
  const LineBits all = (group.levels & ~lines) | (levels & lines);
  // A failed write doesn't change the stored levels: a later write must not make an edge that was
  // reported as failed.
  const int error = group.request->set(lines, all);
  if (error == 0) group.levels = all;
  return error;
}

}  // namespace

HeldLines::HeldLines(Parts&& parts)
    : parts_(std::move(parts)), interrupt_fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (interrupt_fd_ < 0)
    throw GpioError(fmt::format("inputs can't be watched: eventfd: {}", errorText(errno)));
  polled_.push_back({interrupt_fd_, POLLIN, 0});
  for (const auto& group : parts_.input_groups) {
    const std::vector<int>& fds = group->request->edgeFds();
    for (std::size_t i = 0; i < fds.size(); ++i) {
      polled_.push_back({fds[i], POLLIN, 0});
      sources_.push_back({group.get(), i});
    }
  }
}

HeldLines::~HeldLines() {
  // One by one, in the order of the request; a chip that was removed has no lines to make safe.
  for (const OutputSeat& output : parts_.outputs) {
    if (output.keep_on_release) continue;
    const LineBits line = bitOf(output.seat.index);
    static_cast<void>(
        setLevels(*parts_.output_groups[output.seat.group], line, output.safe_level ? line : 0));
  }
  close(interrupt_fd_);
}

const Seat& HeldLines::seatOf(const LineWrite& write) const noexcept {
  return parts_.outputs[static_cast<std::size_t>(write.output)].seat;
}

int HeldLines::write(const LineWrite* writes, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    if (!has(parts_.outputs, writes[i].output)) return EINVAL;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t group = seatOf(writes[i]).group;
    const bool done = std::any_of(writes, writes + i, [this, group](const LineWrite& earlier) {
      return seatOf(earlier).group == group;
    });
    if (done) continue;
    if (const int error = writeGroup(writes + i, count - i)) return error;
  }
  return 0;
}

int HeldLines::writeGroup(const LineWrite* writes, std::size_t count) noexcept {
  const std::size_t group = seatOf(writes[0]).group;
  LineBits lines = 0;
  LineBits levels = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Seat& seat = seatOf(writes[i]);
    if (seat.group != group) continue;
    const LineBits line = bitOf(seat.index);
    lines |= line;
    levels = writes[i].level ? levels | line : levels & ~line;
  }
  return setLevels(*parts_.output_groups[group], lines, levels);
}

int HeldLines::read(int input) noexcept {
  if (!has(parts_.inputs, input)) return -EINVAL;
  const Seat& seat = parts_.inputs[static_cast<std::size_t>(input)];
  InputGroup& group = *parts_.input_groups[seat.group];
  const std::lock_guard<PriorityMutex> lock(group.mutex);
  return group.request->get(static_cast<int>(seat.index));
}

int HeldLines::waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                            std::size_t capacity) noexcept {
  if (capacity == 0) return -EINVAL;
  const timespec timeout{static_cast<std::time_t>(timeout_ns / kSecond),
                         static_cast<long>(timeout_ns % kSecond)};
  if (ppoll(polled_.data(), polled_.size(), timeout_ns < 0 ? nullptr : &timeout, nullptr) < 0) {
    return errno == EINTR ? 0 : -errno;
  }
  if (polled_[0].revents != 0) {
    eventfd_t interrupts = 0;
    eventfd_read(interrupt_fd_, &interrupts);
  }
  std::size_t count = 0;
  for (std::size_t i = 0; i < sources_.size() && count < capacity; ++i) {
    const short seen = polled_[i + 1].revents;
    if (seen == 0) continue;
    // Without POLLIN, the chip was removed.
    const bool gone = (seen & POLLIN) == 0;
    if (gone && count == 0) polled_[i + 1].fd = -1;  // reported once: it would come again for ever
    const int taken = gone ? -ENODEV : takeEdges(sources_[i], events + count, capacity - count);
    if (taken < 0) return count > 0 ? static_cast<int>(count) : taken;
    count += static_cast<std::size_t>(taken);
  }
  return static_cast<int>(count);
}

int HeldLines::takeEdges(const EdgeSource& source, EdgeEvent* events,
                         std::size_t capacity) noexcept {
  InputGroup& group = *source.group;
  const std::lock_guard<PriorityMutex> lock(group.mutex);
  const int count = group.request->takeEdges(source.fd, events, capacity);
  if (count <= 0) return count;
  // Kernels before 5.7 stamp with CLOCK_REALTIME, which is far in the future here.
  const std::int64_t now = steadyNow();
  for (int i = 0; i < count; ++i) {
    events[i].input = group.inputs[static_cast<std::size_t>(events[i].input)];
    events[i].time_ns = std::min(events[i].time_ns, now);
  }
  return count;
}

void HeldLines::interrupt() noexcept { eventfd_write(interrupt_fd_, 1); }

const std::string& HeldLines::outputName(int output) const {
  return parts_.output_names.at(static_cast<std::size_t>(output));
}

const std::string& HeldLines::inputName(int input) const {
  return parts_.input_names.at(static_cast<std::size_t>(input));
}

std::size_t HeldLines::outputChip(int output) const {
  return parts_.outputs.at(static_cast<std::size_t>(output)).seat.group;
}

}  // namespace stepdriver::gpio::gpiod
