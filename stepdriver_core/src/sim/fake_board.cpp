#include "fake_board.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace stepdriver::sim {
namespace {

constexpr std::int64_t kNoTick = std::numeric_limits<std::int64_t>::max();
constexpr unsigned kPinsOfRp2040 = 30;

const char* const kFirmwareCommands[] = {
    "identify offset=%u count=%c",
    "get_config",
    "allocate_oids count=%c",
    "finalize_config crc=%u",
    "get_clock",
    "get_uptime",
    "emergency_stop",
    "clear_shutdown",
    "reset",
    "config_stepper oid=%c step_pin=%c dir_pin=%c invert_step=%c step_pulse_ticks=%u",
    "queue_step oid=%c interval=%u count=%hu add=%hi",
    "set_next_step_dir oid=%c dir=%c",
    "reset_step_clock oid=%c clock=%u",
    "stepper_get_position oid=%c",
    "stepper_stop_on_trigger oid=%c trsync_oid=%c",
    "config_trsync oid=%c",
    "trsync_start oid=%c report_clock=%u report_ticks=%u expire_reason=%c",
    "trsync_set_timeout oid=%c clock=%u",
    "trsync_trigger oid=%c reason=%c",
    "config_endstop oid=%c pin=%c pull_up=%c",
    ("endstop_home oid=%c clock=%u sample_ticks=%u sample_count=%c rest_ticks=%u pin_value=%c "
     "trsync_oid=%c trigger_reason=%c"),
    "endstop_query_state oid=%c",
    "config_digital_out oid=%c pin=%u value=%c default_value=%c max_duration=%u",
    "update_digital_out oid=%c value=%c",
};

const char* const kFirmwareAnswers[] = {
    "identify_response offset=%u data=%.*s",
    "config is_config=%c crc=%u is_shutdown=%c move_count=%hu",
    "clock clock=%u",
    "uptime high=%u clock=%u",
    "stepper_position oid=%c pos=%i",
    "trsync_state oid=%c can_trigger=%c trigger_reason=%c clock=%u",
    "endstop_state oid=%c homing=%c next_clock=%u pin_value=%c",
    "shutdown clock=%u static_string_id=%hu",
    "is_shutdown static_string_id=%hu",
    "starting",
    "stats count=%u sum=%u sumsq=%u",
};

const char* const kReasons[] = {
    "Timer too close",
    "Command request",
    "Move queue overflow",
    "Missed scheduling of next digital out event",
    "Can't reset time when stepper active",
    "Invalid oid type",
    "Already finalized",
    "Not a valid pin",
    "Unknown command",
};

std::string firstWord(const std::string& format) { return format.substr(0, format.find(' ')); }

std::string inQuotes(const std::string& text) { return '"' + text + '"'; }

}  // namespace

BoardKind rp2040() { return {"rp2040", 12e6, 1024, kPinsOfRp2040}; }
BoardKind stm32f446() { return {"stm32f446xx", 180e6, 1024, 80}; }
BoardKind atmega2560() { return {"atmega2560", 16e6, 275, 86}; }

struct FakeBoard::Format {
  std::string text;
  std::string name;
  std::size_t arguments = 0;
};

struct FakeBoard::Stepper {
  struct Move {
    std::uint32_t interval = 0;
    std::uint32_t count = 0;
    std::int32_t add = 0;
    bool turns = false;
  };
  unsigned step_pin = 0;
  unsigned dir_pin = 0;
  bool inverted = false;
  std::uint32_t pulse_ticks = 0;
  bool needs_reset = true;
  bool dir = false;       // of the line
  bool last_dir = false;  // of the last queued move
  bool next_dir = false;
  std::deque<Move> moves;
  std::uint32_t left = 0;  // steps of the move that is played, without the pulse that is out
  std::uint32_t interval = 0;
  std::int32_t add = 0;
  std::int64_t last = 0;       // when the last step was due
  std::int64_t due = kNoTick;  // of the next edge
  bool high = false;
  std::int32_t position = 0;
  std::optional<std::uint32_t> trsync;
};

struct FakeBoard::Trsync {
  bool can_trigger = false;
  std::uint32_t reason = 0;
  std::uint32_t report_ticks = 0;
  std::int64_t reports = kNoTick;
};

struct FakeBoard::Endstop {
  unsigned pin = 0;
  bool homing = false;
  bool level = false;
  std::uint32_t sample_ticks = 0;
  std::uint32_t rest_ticks = 0;
  std::uint32_t sample_count = 0;
  std::uint32_t hits = 0;
  std::uint32_t trsync = 0;
  std::uint32_t reason = 0;
  std::int64_t first_hit = 0;
  std::int64_t due = kNoTick;
};

struct FakeBoard::DigitalOut {
  unsigned pin = 0;
  bool at_shutdown = false;
  std::uint32_t max_duration = 0;
  std::int64_t ends = kNoTick;
};

FakeBoard::FakeBoard(BoardPins& pins, BoardKind kind, double drift_ppm,
                     std::uint32_t clock_at_start)
    : pins_(pins),
      kind_(std::move(kind)),
      frequency_(kind_.clock_hz * (1.0 + drift_ppm * 1e-6)),
      clock_at_start_(clock_at_start) {
  now_ = clock_at_start_;
}

FakeBoard::~FakeBoard() = default;

void FakeBoard::lack(const std::string& format) { lacking_.push_back(format); }

// ---- what it says of itself ----

void FakeBoard::describe() {
  std::string json = fmt::format(
      "{{\"version\": \"v0.12.0-1-fake\", \"config\": {{\"MCU\": \"{}\", "
      "\"CLOCK_FREQ\": {:.0f}}}, \"commands\": {{",
      kind_.mcu, kind_.clock_hz);
  std::uint32_t id = 1;
  const char* comma = "";
  for (const char* format : kFirmwareCommands) {
    Format known{format, firstWord(format), 0};
    known.arguments =
        static_cast<std::size_t>(std::count(known.text.begin(), known.text.end(), '='));
    const bool lacks = std::find(lacking_.begin(), lacking_.end(), known.text) != lacking_.end();
    commands_.push_back(known);
    // Real numbers aren't dense, and some need two bytes.
    if (!lacks) json += comma + inQuotes(known.text) + ": " + std::to_string(id);
    comma = ", ";
    id = id == 1 ? 70 : id + 3;
  }
  json += "}, \"responses\": {";
  comma = "";
  id = 0;
  for (const char* format : kFirmwareAnswers) {
    answers_[firstWord(format)] = id;
    json += comma + inQuotes(format) + ": " + std::to_string(id);
    comma = ", ";
    id = id == 0 ? 69 : id + 3;
  }
  json +=
      "}, \"output\": {\"debug_result val=%u\": 300}, \"enumerations\": {\"static_string_id\": {";
  comma = "";
  id = 2;
  for (const char* reason : kReasons) {
    texts_[reason] = id;
    json += comma + inQuotes(reason) + ": " + std::to_string(id++);
    comma = ", ";
  }
  json += fmt::format("}}, \"pin\": {{\"gpio0\": [0, {}]}}}}}}", kind_.pins);
  uLongf size = compressBound(static_cast<uLong>(json.size()));
  dictionary_.resize(size);
  compress(dictionary_.data(), &size, reinterpret_cast<const Bytef*>(json.data()),
           static_cast<uLong>(json.size()));
  dictionary_.resize(size);
}

void FakeBoard::identify(std::uint32_t offset, std::uint32_t count) {
  Bytes content;
  addInteger(content, 0);
  addInteger(content, offset);
  const std::size_t begin = std::min<std::size_t>(offset, dictionary_.size());
  const std::size_t size = std::min<std::size_t>(count, dictionary_.size() - begin);
  content.push_back(static_cast<std::uint8_t>(size));
  content.insert(content.end(), dictionary_.begin() + static_cast<std::ptrdiff_t>(begin),
                 dictionary_.begin() + static_cast<std::ptrdiff_t>(begin + size));
  wire_.send(content);
}

void FakeBoard::answer(const std::string& name, const std::vector<std::uint32_t>& arguments) {
  Bytes content;
  addInteger(content, answers_.at(name));
  for (const std::uint32_t argument : arguments) addInteger(content, argument);
  wire_.send(content);
}

// ---- commands ----

void FakeBoard::receive(const std::uint8_t* bytes, std::size_t count) {
  if (dictionary_.empty()) describe();
  const std::uint64_t starts = starts_;
  for (const Bytes& block : wire_.receive(bytes, count)) {
    BoardReader reader(block);
    // Whatever shuts it down ends the block too.
    const std::uint64_t shutdowns = shutdowns_;
    while (!reader.isAtEnd() && starts == starts_ && shutdowns == shutdowns_) handle(reader);
    if (starts != starts_) return;
    wire_.acknowledge();
  }
}

void FakeBoard::handle(BoardReader& reader) {
  const std::uint32_t id = reader.next();
  const std::size_t index = id == 1 ? 0 : (id - 70) / 3 + 1;
  if (id != 1 && (id < 70 || (id - 70) % 3 != 0 || index >= commands_.size())) {
    while (!reader.isAtEnd()) reader.next();
    return shutDown("Unknown command");
  }
  const Format& format = commands_[index];
  std::vector<std::uint32_t> arguments;
  for (std::size_t i = 0; i < format.arguments; ++i) arguments.push_back(reader.next());
  const std::string& name = format.name;
  if (name == "identify") return identify(arguments[0], arguments[1]);
  if (name == "get_config") {
    return answer("config", {config_ ? 1U : 0U, config_.value_or(0), shutdown_ ? 1U : 0U,
                             config_ ? kind_.move_count : 0U});
  }
  if (name == "get_clock") return answer("clock", {static_cast<std::uint32_t>(now_)});
  if (name == "get_uptime") {
    return answer("uptime",
                  {static_cast<std::uint32_t>(now_ >> 32), static_cast<std::uint32_t>(now_)});
  }
  if (name == "emergency_stop") return shutDown("Command request");
  if (name == "reset") return powerCycle();
  if (shutdown_) return answer("is_shutdown", {*shutdown_});
  if (!configures(name, arguments) && !steps(name, arguments) && !watches(name, arguments)) {
    shutDown("Unknown command");
  }
}

template <typename Object>
Object* FakeBoard::find(std::map<std::uint32_t, Object>& objects, std::uint32_t oid) {
  const auto found = objects.find(oid);
  if (found != objects.end()) return &found->second;
  shutDown("Invalid oid type");
  return nullptr;
}

bool FakeBoard::configures(const std::string& name, const std::vector<std::uint32_t>& arguments) {
  if (name.rfind("config_", 0) == 0 && (config_ || arguments[0] >= oids_)) {
    shutDown(config_ ? "Already finalized" : "Invalid oid type");
    return true;
  }
  bool right = true;
  if (name == "allocate_oids") {
    oids_ = arguments[0];
  } else if (name == "finalize_config") {
    config_ = arguments[0];
  } else if (name == "config_stepper") {
    Stepper stepper;
    stepper.step_pin = arguments[1];
    stepper.dir_pin = arguments[2];
    stepper.inverted = arguments[3] == 1;
    stepper.pulse_ticks = arguments[4];
    right = arguments[1] < kind_.pins && arguments[2] < kind_.pins &&
            pins_.drive(arguments[1], stepper.inverted) && pins_.drive(arguments[2], false);
    steppers_[arguments[0]] = stepper;
  } else if (name == "config_trsync") {
    trsyncs_[arguments[0]] = {};
  } else if (name == "config_endstop") {
    Endstop endstop;
    endstop.pin = arguments[1];
    right = arguments[1] < kind_.pins && pins_.listen(arguments[1]);
    endstops_[arguments[0]] = endstop;
  } else if (name == "config_digital_out") {
    DigitalOut output;
    output.pin = arguments[1];
    output.at_shutdown = arguments[3] != 0;
    output.max_duration = arguments[4];
    right = arguments[1] < kind_.pins && pins_.drive(arguments[1], arguments[2] != 0);
    outputs_[arguments[0]] = output;
  } else {
    return false;
  }
  if (!right) shutDown("Not a valid pin");
  return true;
}

bool FakeBoard::steps(const std::string& name, const std::vector<std::uint32_t>& arguments) {
  if (name == "update_digital_out") {
    if (DigitalOut* output = find(outputs_, arguments[0])) {
      const bool level = arguments[1] != 0;
      pins_.write(output->pin, level);
      const bool is_limited = output->max_duration != 0 && level != output->at_shutdown;
      output->ends = is_limited ? now_ + output->max_duration : kNoTick;
    }
    return true;
  }
  if (name != "queue_step" && name != "set_next_step_dir" && name != "reset_step_clock" &&
      name != "stepper_get_position" && name != "stepper_stop_on_trigger") {
    return false;
  }
  Stepper* stepper = find(steppers_, arguments[0]);
  if (stepper == nullptr) return true;
  if (name == "queue_step") {
    queueStep(*stepper, arguments);
  } else if (name == "set_next_step_dir") {
    stepper->next_dir = arguments[1] != 0;
  } else if (name == "reset_step_clock") {
    if (stepper->due != kNoTick) {
      shutDown("Can't reset time when stepper active");
      return true;
    }
    stepper->last = widened(arguments[1]);
    stepper->needs_reset = false;
  } else if (name == "stepper_get_position") {
    answer("stepper_position", {arguments[0], static_cast<std::uint32_t>(stepper->position)});
  } else {
    stepper->trsync = arguments[1];
  }
  return true;
}

bool FakeBoard::watches(const std::string& name, const std::vector<std::uint32_t>& arguments) {
  if (name.rfind("trsync_", 0) == 0) {
    Trsync* trsync = find(trsyncs_, arguments[0]);
    if (trsync == nullptr) return true;
    if (name == "trsync_start") {
      trsync->can_trigger = true;
      trsync->reason = 0;
      trsync->report_ticks = arguments[2];
      trsync->reports = arguments[2] != 0 ? widened(arguments[1]) : kNoTick;
      for (auto& [oid, stepper] : steppers_) {
        if (stepper.trsync == arguments[0]) stepper.trsync.reset();
      }
    } else if (name == "trsync_trigger") {
      trigger(*trsync, arguments[1]);
      trsync->reports = kNoTick;
      report(*trsync, arguments[0]);
    }
    return true;
  }
  if (name != "endstop_home" && name != "endstop_query_state") return false;
  Endstop* endstop = find(endstops_, arguments[0]);
  if (endstop == nullptr) return true;
  if (name == "endstop_home") {
    endstop->homing = arguments[3] != 0;
    endstop->hits = 0;
    endstop->due = endstop->homing ? widened(arguments[1]) : kNoTick;
    if (endstop->due < now_) {
      shutDown("Timer too close");
      return true;
    }
    endstop->sample_ticks = arguments[2];
    endstop->sample_count = arguments[3];
    endstop->rest_ticks = arguments[4];
    endstop->level = arguments[5] != 0;
    endstop->trsync = arguments[6];
    endstop->reason = arguments[7];
  } else {
    answer("endstop_state", {arguments[0], endstop->homing ? 1U : 0U,
                             static_cast<std::uint32_t>(endstop->homing ? endstop->due : 0),
                             pins_.read(endstop->pin) ? 1U : 0U});
  }
  return true;
}

// ---- steps ----

void FakeBoard::countEntries() {
  std::size_t entries = 0;
  for (const auto& [oid, stepper] : steppers_) entries += stepper.moves.size();
  most_entries_ = std::max(most_entries_, entries);
  if (entries > kind_.move_count) shutDown("Move queue overflow");
}

void FakeBoard::queueStep(Stepper& stepper, const std::vector<std::uint32_t>& arguments) {
  if (stepper.needs_reset) {
    ++dropped_moves_;
    return;
  }
  Stepper::Move move{arguments[1], arguments[2], static_cast<std::int16_t>(arguments[3]), false};
  move.turns = stepper.next_dir != stepper.last_dir;
  stepper.last_dir = stepper.next_dir;
  stepper.moves.push_back(move);
  countEntries();
  if (!shutdown_ && stepper.due == kNoTick) loadNext(stepper);
}

void FakeBoard::loadNext(Stepper& stepper) {
  if (stepper.moves.empty()) {
    stepper.due = kNoTick;
    return;
  }
  const Stepper::Move move = stepper.moves.front();
  stepper.moves.pop_front();
  if (move.turns) {
    stepper.dir = !stepper.dir;
    pins_.write(stepper.dir_pin, stepper.dir);
  }
  stepper.left = move.count;
  stepper.interval = move.interval;
  stepper.add = move.add;
  // The counter has 32 bits: an interval is the next time that it shows that number.
  stepper.last = widened(static_cast<std::uint32_t>(stepper.last) + stepper.interval);
  stepper.interval += static_cast<std::uint32_t>(stepper.add);
  stepper.due = stepper.last;
  const auto millisecond = static_cast<std::int64_t>(kind_.clock_hz / 1000.0);
  if (stepper.due < now_ - millisecond) return shutDown("Timer too close");
  if (stepper.due < now_) {
    ++pushed_back_;
    stepper.due = now_;
  }
}

void FakeBoard::playEdge(Stepper& stepper) {
  if (!stepper.high) {
    stepper.high = true;
    --stepper.left;
    stepper.position += stepper.dir ? 1 : -1;
    pins_.write(stepper.step_pin, !stepper.inverted);
    stepper.due = now_ + stepper.pulse_ticks;
    return;
  }
  stepper.high = false;
  pins_.write(stepper.step_pin, stepper.inverted);
  const std::int64_t soonest = now_ + stepper.pulse_ticks;
  if (stepper.left == 0) {
    loadNext(stepper);
    if (stepper.due == kNoTick) return;
  } else {
    stepper.last = widened(static_cast<std::uint32_t>(stepper.last) + stepper.interval);
    stepper.interval += static_cast<std::uint32_t>(stepper.add);
    stepper.due = stepper.last;
  }
  if (stepper.due < soonest) {
    ++pushed_back_;
    stepper.due = soonest;
  }
}

void FakeBoard::stop(Stepper& stepper) {
  stepper.moves.clear();
  stepper.left = 0;
  stepper.due = kNoTick;
  stepper.needs_reset = true;
  if (stepper.high) pins_.write(stepper.step_pin, stepper.inverted);
  stepper.high = false;
  if (stepper.dir) pins_.write(stepper.dir_pin, false);
  stepper.dir = stepper.last_dir = stepper.next_dir = false;
}

void FakeBoard::trigger(Trsync& trsync, std::uint32_t reason) {
  if (!trsync.can_trigger) return;
  trsync.can_trigger = false;
  trsync.reason = reason;
  for (auto& [oid, known] : trsyncs_) {
    if (&known != &trsync) continue;
    for (auto& [stepper_oid, stepper] : steppers_) {
      if (stepper.trsync != oid) continue;
      stepper.trsync.reset();
      stop(stepper);
    }
  }
}

void FakeBoard::report(const Trsync& trsync, std::uint32_t oid) {
  answer("trsync_state",
         {oid, trsync.can_trigger ? 1U : 0U, trsync.reason, static_cast<std::uint32_t>(now_)});
}

void FakeBoard::sample(Endstop& endstop) {
  if (pins_.read(endstop.pin) != endstop.level) {
    endstop.due =
        endstop.hits == 0 ? now_ + endstop.rest_ticks : endstop.first_hit + endstop.rest_ticks;
    if (endstop.due <= now_) endstop.due = now_ + endstop.rest_ticks;
    endstop.hits = 0;
    return;
  }
  if (endstop.hits++ == 0) endstop.first_hit = now_;
  endstop.due = now_ + endstop.sample_ticks;
  if (endstop.hits < endstop.sample_count) return;
  endstop.homing = false;
  endstop.due = kNoTick;
  if (Trsync* trsync = find(trsyncs_, endstop.trsync)) {
    trigger(*trsync, endstop.reason);
    report(*trsync, endstop.trsync);
  }
}

void FakeBoard::shutDown(const std::string& reason) {
  ++shutdowns_;
  if (shutdown_) return;
  reason_ = reason;
  shutdown_ = texts_.count(reason) != 0 ? texts_.at(reason) : 0;
  for (auto& [oid, stepper] : steppers_) stop(stepper);
  for (auto& [oid, trsync] : trsyncs_) trsync = {};
  for (auto& [oid, endstop] : endstops_) {
    endstop.homing = false;
    endstop.due = kNoTick;
  }
  for (auto& [oid, output] : outputs_) {
    output.ends = kNoTick;
    pins_.write(output.pin, output.at_shutdown);
  }
  answer("shutdown", {static_cast<std::uint32_t>(now_), *shutdown_});
}

void FakeBoard::powerCycle() {
  for (auto& [oid, stepper] : steppers_) stop(stepper);
  for (auto& [oid, output] : outputs_) pins_.write(output.pin, output.at_shutdown);
  steppers_.clear();
  trsyncs_.clear();
  endstops_.clear();
  outputs_.clear();
  config_.reset();
  shutdown_.reset();
  oids_ = 0;
  wire_.reset();
  ++starts_;
  if (!answers_.empty()) answer("starting", {});
}

void FakeBoard::configuredBy(std::uint32_t crc) { config_ = crc; }

// ---- time ----

std::int64_t FakeBoard::tickOf(Nanoseconds time) const {
  return clock_at_start_ +
         static_cast<std::int64_t>(std::floor(static_cast<double>(time) * 1e-9 * frequency_));
}

FakeBoard::Nanoseconds FakeBoard::timeOf(std::int64_t tick) const {
  const auto ticks = static_cast<double>(tick - clock_at_start_);
  auto time = static_cast<Nanoseconds>(std::ceil(ticks / frequency_ * 1e9));
  while (tickOf(time) < tick) ++time;
  return time;
}

std::int64_t FakeBoard::widened(std::uint32_t ticks) const {
  return now_ + static_cast<std::int32_t>(ticks - static_cast<std::uint32_t>(now_));
}

std::int64_t FakeBoard::nextEvent() const {
  std::int64_t next = kNoTick;
  for (const auto& [oid, stepper] : steppers_) next = std::min(next, stepper.due);
  for (const auto& [oid, trsync] : trsyncs_) next = std::min(next, trsync.reports);
  for (const auto& [oid, endstop] : endstops_) next = std::min(next, endstop.due);
  for (const auto& [oid, output] : outputs_) next = std::min(next, output.ends);
  return next;
}

FakeBoard::Nanoseconds FakeBoard::due() const {
  const std::int64_t next = nextEvent();
  return next == kNoTick ? std::numeric_limits<Nanoseconds>::max() : timeOf(next);
}

void FakeBoard::playAt(std::int64_t tick) {
  now_ = std::max(now_, tick);
  // Switches are read before a step of the same tick goes out.
  for (auto& [oid, endstop] : endstops_) {
    if (endstop.due <= tick) sample(endstop);
  }
  for (auto& [oid, stepper] : steppers_) {
    if (stepper.due <= tick) playEdge(stepper);
  }
  for (auto& [oid, trsync] : trsyncs_) {
    if (trsync.reports > tick) continue;
    trsync.reports += trsync.report_ticks;
    report(trsync, oid);
  }
  for (auto& [oid, output] : outputs_) {
    if (output.ends <= tick) return shutDown("Missed scheduling of next digital out event");
  }
}

void FakeBoard::play(Nanoseconds now) {
  const std::int64_t until = tickOf(now);
  for (;;) {
    const std::int64_t next = nextEvent();
    if (next > until) break;
    playAt(next);
  }
  now_ = std::max(now_, until);
}

}  // namespace stepdriver::sim
