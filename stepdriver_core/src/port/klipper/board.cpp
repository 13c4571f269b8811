#include "port/klipper/board.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "gpio/chip_table.h"

namespace stepdriver::klipper {
namespace {

// How often an answer is looked for at the start, each time for kLook.
constexpr int kLooks = 300;
constexpr Nanoseconds kLook = 10 * kMillisecond;
// An answer may be lost: the question is repeated after so many looks.
constexpr int kLooksUntilAskingAgain = 50;
constexpr int kClockReadings = 8;
constexpr int kLooksForDelivery = 30;
// How long a board that was reset is looked for, and the pause before each look.
constexpr auto kLongestReturn = std::chrono::seconds(10);
constexpr auto kReturn = std::chrono::milliseconds(200);
// The first seconds tell how fast its clock is: it is read more often then.
constexpr Nanoseconds kFirstClockPeriod = 100 * kMillisecond;
constexpr int kFirstClocks = 20;
// Without an answer to a block for so long, the line is cut: it was repeated six times by then.
constexpr Nanoseconds kSilence = 2'000 * kMillisecond;
constexpr Nanoseconds kClockPeriod = 1'000 * kMillisecond;
// An answer that is awaited is looked for each millisecond, any other word of the board every 20.
constexpr Nanoseconds kAwaited = kMillisecond;
constexpr Nanoseconds kUnawaited = 20 * kMillisecond;
constexpr std::size_t kMostDictionary = 1'000'000;

}  // namespace

Board::Board(std::string name, Open open, pulse::Clock& clock, Options options)
    : name_(std::move(name)), open_(std::move(open)), clock_(clock), options_(options) {}

// ---- at the start ----

void Board::openLine() {
  start_failure_.clear();
  link_.reset();  // the port is locked as long as it is open
  link_ = open_();
  transport_ = Transport();
}

void Board::connect() {
  transport_.connect(clock_.now());
  for (int i = 0; i < kLooks; ++i) {
    transmit(clock_.now());
    link_->await(kLook);
    receive();
    throwIfFailed();
    if (transport_.isConnected() && transport_.isIdle()) return;
  }
  throw BoardError(
      fmt::format("the board {} doesn't answer: check its cable and its power, that the port is "
                  "the board's, and that Klipper's firmware is on it",
                  name_));
}

void Board::throwIfFailed() const {
  if (!start_failure_.empty()) throw BoardError(start_failure_);
}

std::vector<std::uint8_t> Board::readIdentity() {
  openLine();
  connect();
  std::vector<std::uint8_t> identity;
  for (;;) {
    const std::size_t before = identity.size();
    const Message question = klipper::identify(static_cast<std::uint32_t>(before));
    std::size_t last = kPiece;
    for (int i = 0; i < kLooks && identity.size() == before && last != 0; ++i) {
      if (i % kLooksUntilAskingAgain == 0) transport_.send(question.bytes.data(), question.size);
      transmit(clock_.now());
      throwIfFailed();
      link_->await(kLook);
      std::array<std::uint8_t, 4096> bytes{};
      const auto count = link_->read(bytes.data(), bytes.size());
      for (std::ptrdiff_t at = 0; at < count;) {
        at += static_cast<std::ptrdiff_t>(
            transport_.receive(bytes.data() + at, static_cast<std::size_t>(count - at)));
        while (const auto frame = transport_.next(clock_.now())) {
          const auto piece = identified(frame->content, frame->content + frame->size);
          if (!piece || piece->offset != identity.size()) continue;
          identity.insert(identity.end(), piece->data, piece->data + piece->size);
          last = piece->size;
        }
      }
    }
    if (last == 0) return identity;
    if (identity.size() == before || identity.size() > kMostDictionary) {
      throw BoardError(fmt::format("the board {} doesn't say which firmware it has", name_));
    }
  }
}

void Board::identify() {
  identity_ = readIdentity();
  dictionary_ = Dictionary::unpacked(identity_);
  messages_.emplace(dictionary_, name_);
  mcu_ = dictionary_.text("MCU");
  const auto frequency = dictionary_.number("CLOCK_FREQ");
  if (!frequency || *frequency < 1'000'000 || *frequency > 2'000'000'000) {
    throw BoardError(fmt::format("the board {} doesn't say how fast its clock is", name_));
  }
  board_clock_ = std::make_unique<BoardClock>(static_cast<double>(*frequency));
}

std::uint32_t Board::pin(const std::string& name) const {
  const auto number = dictionary_.pin(name);
  if (number) return *number;
  throw BoardError(fmt::format("the board {} ({}) has no pin {}; it has {}", name_, mcu_, name,
                               dictionary_.pinNames()));
}

std::uint32_t Board::ticksOf(Nanoseconds time) const {
  // Its clock may be a little faster than it says.
  constexpr double kFaster = 1.005;
  return static_cast<std::uint32_t>(
      std::ceil(static_cast<double>(time) * 1e-9 * board_clock_->nominal() * kFaster));
}

void Board::add(Command command, std::initializer_list<std::uint32_t> arguments) {
  objects_.push_back(messages_->encode(command, arguments));
}

std::uint32_t Board::addStepper(std::uint32_t step_pin, std::uint32_t dir_pin, bool inverted,
                                std::uint32_t pulse_ticks) {
  add(Command::kConfigStepper, {oids_, step_pin, dir_pin, inverted ? 1U : 0U, pulse_ticks});
  return oids_++;
}

std::uint32_t Board::addTrsync() {
  add(Command::kConfigTrsync, {oids_});
  return oids_++;
}

std::uint32_t Board::addEndstop(std::uint32_t pin, bool pull_up) {
  add(Command::kConfigEndstop, {oids_, pin, pull_up ? 1U : 0U});
  return oids_++;
}

std::uint32_t Board::addOutput(std::uint32_t pin, bool level, bool watched) {
  const std::uint32_t most = watched ? ticksOf(kWatchdog) : 0;
  add(Command::kConfigDigitalOut, {oids_, pin, level ? 1U : 0U, level ? 1U : 0U, most});
  outputs_.push_back({oids_, level, level, watched});
  return oids_++;
}

std::optional<Heard> Board::exchange(Answer answer, std::optional<std::uint32_t> oid) {
  transmit(clock_.now());
  link_->await(kLook);
  awaited_.reset();
  receive();
  throwIfFailed();
  if (!awaited_ || awaited_->answer != answer || (oid && awaited_->arguments[0] != *oid)) {
    return std::nullopt;
  }
  return awaited_;
}

Heard Board::ask(Command command, std::initializer_list<std::uint32_t> arguments, Answer answer) {
  const std::optional<std::uint32_t> oid =
      arguments.size() == 0 ? std::nullopt : std::optional<std::uint32_t>(*arguments.begin());
  for (int i = 0; i < kLooks; ++i) {
    if (i % kLooksUntilAskingAgain == 0) send(command, arguments);
    if (const auto heard = exchange(answer, oid)) return *heard;
  }
  throw BoardError(fmt::format("the board {} doesn't answer to \"{}\"", name_, formatOf(command)));
}

// Most firmwares know how to reset the whole chip; that of a Linux process begins anew.
void Board::reset() {
  auto command = dictionary_.command("reset");
  if (!command) command = dictionary_.command("config_reset");
  if (!command) {
    throw BoardError(fmt::format(
        "the board {} must be reset, and its firmware can't do that by itself: press its reset "
        "button, or switch it off and on",
        name_));
  }
  // What is in a block behind a command that shuts the firmware down is lost.
  send(Command::kEmergencyStop, {});
  awaitDelivery();
  std::array<std::uint8_t, 8> bytes{};
  std::uint8_t* out = bytes.data();
  if (*command >= -32 && *command < 96) {
    *out++ = static_cast<std::uint8_t>(*command & 0x7F);
  } else {
    *out++ = static_cast<std::uint8_t>(((*command >> 7) & 0x7F) | 0x80);
    *out++ = static_cast<std::uint8_t>(*command & 0x7F);
  }
  transport_.send(bytes.data(), static_cast<std::size_t>(out - bytes.data()));
  awaitDelivery();
  comeBack();
}

// A board that resets itself may not be able to confirm that any more.
void Board::awaitDelivery() {
  for (int i = 0; i < kLooksForDelivery && !hasFailed() && !transport_.isIdle(); ++i) {
    transmit(clock_.now());
    link_->await(kLook);
    receive();
  }
}

// A port of USB goes when its board is reset, and needs some seconds to come back.
void Board::comeBack() {
  const auto end = std::chrono::steady_clock::now() + kLongestReturn;
  for (;;) {
    try {
      return checkIdentity();
    } catch (const BoardError&) {
      if (std::chrono::steady_clock::now() > end) throw;
    }
    std::this_thread::sleep_for(kReturn);
  }
}

void Board::checkIdentity() {
  if (readIdentity() == identity_) return;
  throw BoardError(
      fmt::format("the board {} has another firmware now, instead of {}: start the node again",
                  name_, version()));
}

void Board::configure() {
  std::uint32_t crc = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
  for (const Message& object : objects_) {
    crc =
        static_cast<std::uint32_t>(crc32(crc, object.bytes.data(), static_cast<uInt>(object.size)));
  }
  Heard config = ask(Command::kGetConfig, {}, Answer::kConfig);
  const bool is_foreign = config.arguments[0] != 0 && config.arguments[1] != crc;
  if (config.arguments[2] == 0 && is_foreign && !options_.resets_foreign) {
    throw BoardError(
        fmt::format("the board {} was configured by another program, or for other lines: stop that "
                    "program and reset the board, or set boards/{}/reset: true",
                    name_, name_));
  }
  if (config.arguments[2] != 0 || is_foreign) {
    reset();
    config = ask(Command::kGetConfig, {}, Answer::kConfig);
    if (config.arguments[0] != 0 || config.arguments[2] != 0) {
      throw BoardError(fmt::format("the board {} can't be reset: switch it off and on", name_));
    }
  }
  if (config.arguments[0] == 0) {
    send(Command::kAllocateOids, {oids_});
    for (const Message& object : objects_) transport_.send(object.bytes.data(), object.size);
    send(Command::kFinalizeConfig, {crc});
    config = ask(Command::kGetConfig, {}, Answer::kConfig);
  }
  if (config.arguments[0] == 0 || config.arguments[1] != crc || config.arguments[2] != 0) {
    throw BoardError(fmt::format("the board {} didn't take its configuration", name_));
  }
  move_count_ = static_cast<std::uint16_t>(config.arguments[3]);
  for (const Output& output : outputs_) {
    send(Command::kUpdateDigitalOut, {output.oid, output.at_shutdown ? 1U : 0U});
  }
  readClock();
}

void Board::readClock() {
  const Heard uptime = ask(Command::kGetUptime, {}, Answer::kUptime);
  static_cast<void>(uptime);  // the upper half counts the turns of the clock: nobody needs them
  for (int i = 0; i < kClockReadings; ++i) {
    const Nanoseconds sent = clock_.now();
    const Heard answer = ask(Command::kGetClock, {}, Answer::kClock);
    board_clock_->add({sent, clock_.now(), answer.arguments[0]});
  }
  clock_due_ = clock_.now() + kFirstClockPeriod;
}

// ---- after a failure ----

void Board::release() {
  Owner failed = Owner::kFailed;
  owner_.compare_exchange_strong(failed, Owner::kNobody, std::memory_order_acq_rel);
}

void Board::reopen() {
  listener_ = nullptr;
  checkIdentity();
  board_clock_ = std::make_unique<BoardClock>(board_clock_->nominal());
  clock_asked_.reset();
  clocks_ = 0;
  outputs_due_ = 0;
  for (Output& output : outputs_) output.level = output.at_shutdown;
  configure();
}

void Board::resume() {
  owner_.store(Owner::kServer, std::memory_order_relaxed);
  resumed_.fetch_add(1, std::memory_order_relaxed);
  failure_.store(0, std::memory_order_release);
}

void Board::stayFailed(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(reason_mutex_);
  reason_ = reason;
}

// ---- afterwards ----

void Board::send(Command command, std::initializer_list<std::uint32_t> arguments) {
  const Message message = messages_->encode(command, arguments);
  transport_.send(message.bytes.data(), message.size);
}

void Board::setOutput(std::uint32_t oid, bool level) {
  for (Output& output : outputs_) {
    if (output.oid == oid) output.level = level;
  }
  send(Command::kUpdateDigitalOut, {oid, level ? 1U : 0U});
}

void Board::serve(Nanoseconds now) {
  if (failure() != 0) return;
  // What the board has said comes first: after a pause of this program it has long answered.
  receive();
  if (failure() != 0) return;
  keepTime(now);
  keepOutputs(now);
  transmit(now);
  receive();
  if (failure() == 0 && transport_.waitsSince() < now - kSilence) {
    fail(ETIMEDOUT, fmt::format("the board {} hasn't answered for 2 s", name_), now);
  }
}

void Board::failLine(int error, Nanoseconds now) {
  const std::string why = error == ENODEV ? "its port is gone: was its cable pulled, or its power?"
                                          : gpio::errorText(error);
  fail(error, fmt::format("the line to the board {} has failed: {}", name_, why), now);
}

void Board::receive() {
  std::array<std::uint8_t, 4096> bytes{};
  for (;;) {
    const auto count = link_->read(bytes.data(), bytes.size());
    // This thread may have waited for a processor: what the board says is newer than its last look.
    const Nanoseconds now = clock_.now();
    if (count < 0) return failLine(static_cast<int>(-count), now);
    if (count == 0) return;
    for (std::ptrdiff_t at = 0; at < count;) {
      at += static_cast<std::ptrdiff_t>(
          transport_.receive(bytes.data() + at, static_cast<std::size_t>(count - at)));
      while (const auto frame = transport_.next(now)) {
        if (!messages_) continue;
        const std::uint8_t* content = frame->content;
        const std::uint8_t* end = content + frame->size;
        while (const auto heard = messages_->decode(content, end)) {
          hear(*heard, now);
          if (hasFailed()) return;
        }
      }
    }
  }
}

void Board::hear(const Heard& heard, Nanoseconds now) {
  switch (heard.answer) {
    case Answer::kShutdown:
    case Answer::kIsShutdown: {
      const std::uint32_t text = heard.arguments[heard.answer == Answer::kShutdown ? 1 : 0];
      if (listener_ == nullptr) return;  // the configuration deals with it
      return fail(EREMOTEIO,
                  fmt::format("the firmware of the board {} has shut down: {}", name_,
                              dictionary_.staticText(text)),
                  now);
    }
    case Answer::kStarting:
      if (listener_ == nullptr) return;
      return fail(ENODEV, fmt::format("the board {} was reset", name_), now);
    case Answer::kClock:
      if (clock_asked_) board_clock_->add({*clock_asked_, now, heard.arguments[0]});
      clock_asked_.reset();
      break;
    default:
      break;
  }
  if (listener_ != nullptr) {
    listener_->heard(heard, now);
  } else {
    awaited_ = heard;
  }
}

void Board::transmit(Nanoseconds now) {
  for (;;) {
    transport_.serve(now);
    const auto& out = transport_.out();
    if (out.empty()) return;
    const auto count = link_->write(out.data(), out.size());
    if (count < 0) return failLine(static_cast<int>(-count), now);
    if (count == 0) return;
    transport_.written(static_cast<std::size_t>(count));
  }
}

void Board::keepTime(Nanoseconds now) {
  if (now < clock_due_) return;
  clock_due_ = now + (clocks_ < kFirstClocks ? kFirstClockPeriod : kClockPeriod);
  ++clocks_;
  clock_asked_ = now;
  send(Command::kGetClock, {});
}

void Board::keepOutputs(Nanoseconds now) {
  if (now < outputs_due_) return;
  outputs_due_ = pulse::kNever;
  for (const Output& output : outputs_) {
    if (!output.watched || output.level == output.at_shutdown) continue;
    send(Command::kUpdateDigitalOut, {output.oid, output.level ? 1U : 0U});
  }
  outputs_due_ = now + kWatchdog / 4;
}

Nanoseconds Board::due(Nanoseconds now) const {
  if (failure() != 0) return pulse::kNever;
  const bool waits = transport_.waitsSince() != pulse::kNever || !transport_.out().empty();
  return std::min({transport_.due(), clock_due_, outputs_due_, link_->due(),
                   now + (waits ? kAwaited : kUnawaited)});
}

void Board::flush() {
  if (link_ && failure() == 0) awaitDelivery();
}

bool Board::hasFailed() const {
  return listener_ == nullptr ? !start_failure_.empty() : failure() != 0;
}

void Board::fail(int error, const std::string& reason, Nanoseconds now) {
  if (hasFailed()) return;
  if (listener_ == nullptr) {
    start_failure_ = reason;
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(reason_mutex_);
    reason_ = reason;
  }
  owner_.store(Owner::kFailed, std::memory_order_relaxed);
  failure_.store(error, std::memory_order_release);
  listener_->lost(now);
}

std::string Board::reason() const {
  if (failure() == 0) return "";
  const std::lock_guard<std::mutex> lock(reason_mutex_);
  return reason_;
}

}  // namespace stepdriver::klipper
