#include "port/klipper/board_port.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

namespace stepdriver::klipper {
namespace {

using pulse::EndReason;
using pulse::MotorSet;

// A step must be on the board this long before its time: a millisecond on the line, one in which
// nobody looks, and some for a computer that is busy.
constexpr Nanoseconds kLead = 4 * kMillisecond;
// How often a board is asked where its motors stand.
constexpr Nanoseconds kPositions = 10 * kMillisecond;
// An answer that hasn't come by then is asked for again.
constexpr Nanoseconds kAsksAgain = 50 * kMillisecond;
// A motor that stands still for so long although steps are due has been stopped by its board, and
// the word of that was lost.
constexpr Nanoseconds kStalled = 30 * kMillisecond;
// A switch is active if four readings in a row, 15 us apart, say so; it is read every 100 us.
constexpr Nanoseconds kSample = 15'000;
constexpr std::uint32_t kSamples = 4;
constexpr Nanoseconds kRest = 100'000;
// Entries of a board's queue that are left to other uses.
constexpr std::size_t kSpareEntries = 8;

constexpr std::uint32_t kTakenBack = 1;  // reasons of a trsync: the others are its switches
constexpr std::uint32_t kFirstSwitch = 8;

}  // namespace

struct BoardPort::Track {
  struct Stepper {
    bool is_reset = false;  // it takes steps
    bool dir = false;       // of the last step that was sent
    std::int64_t last = 0;  // tick of the last step that was sent, by the firmware's formula
    std::vector<std::int64_t> ticks;  // steps that weren't sent, from `first` on
    std::vector<int> directions;
    std::size_t first = 0;
    std::deque<std::int64_t> entries;  // when runs that were sent begin
    std::int32_t told = 0;             // position by which steps were told to be played
    std::int32_t position = 0;         // the last one that the board has said
    bool is_new = false;               // it has said so since it was asked last
    // Where it stands after a failure. Of the thread that brings the board back, until then.
    std::int32_t resumes_at = 0;
  };
  Channel config;
  std::int64_t error = 1;  // [ticks]
  std::unique_ptr<StepCompressor> compressor;
  std::vector<Stepper> steppers;
  MotorSet still = 0;
  std::deque<Open> open;
  std::int64_t last_tick = 0;  // of the last step that was put
  int last_direction = 0;
  bool stepped = false;
  bool is_lost = false;                       // steps were put while its board wasn't there
  bool sent = false;                          // some of the open steps are on the board
  bool armed = false;                         // the trsync can stop the motors
  int armed_for = 0;                          // the direction whose switches are watched
  std::optional<std::int64_t> disarms_other;  // from this tick on
  bool stopping = false;                      // it was told to stop, or has stopped
  bool has_stopped = false;
  bool has_stalled = false;  // it was stopped because it had stopped by itself
  std::uint32_t stopped_by = kTakenBack;
  bool fails = false;  // the stop is a failure, and not an end of steps
  int error_number = 0;
  Nanoseconds asked = 0;  // when it was asked for positions
  bool awaits = false;    // the answer
  Nanoseconds moved = 0;  // when its count has changed
};

class BoardPort::Ear : public Board::Listener {
 public:
  Ear(BoardPort& port, Board& board) : port_(port), board_(board) {}
  void heard(const Heard& heard, Nanoseconds now) override { port_.heard(board_, heard, now); }
  void lost(Nanoseconds now) override { port_.lost(board_, now); }

 private:
  BoardPort& port_;
  Board& board_;
};

BoardPort::BoardPort(std::vector<Board*> boards, pulse::Clock& clock, std::vector<Channel> channels,
                     Options options, std::function<void()> writes,
                     std::function<void(const Board&, const Heard&, Nanoseconds)> hears)
    : StepPort(channels.size()),
      boards_(std::move(boards)),
      clock_(clock),
      options_(options),
      writes_(std::move(writes)),
      hears_(std::move(hears)),
      entries_(boards_.size()),
      said_(boards_.size()),
      resumed_(boards_.size()),
      usable_(boards_.size(), 1) {
  for (Channel& channel : channels) {
    auto track = std::make_unique<Track>();
    track->config = std::move(channel);
    track->steppers.resize(track->config.motors.size());
    if (track->config.board != nullptr) {
      Board& board = *track->config.board;
      const double ticks =
          static_cast<double>(options_.step_error) * 1e-9 * board.boardClock().nominal();
      track->error = std::max<std::int64_t>(1, static_cast<std::int64_t>(ticks));
      track->compressor = std::make_unique<StepCompressor>(track->error);
      for (std::size_t i = 0; i < track->steppers.size(); ++i) {
        const std::uint32_t oid = track->config.motors[i].oid;
        // It may have been moved by the program before this one.
        const Heard position =
            board.ask(Command::kStepperGetPosition, {oid}, Answer::kStepperPosition);
        track->steppers[i].told = static_cast<std::int32_t>(position.arguments[1]);
        track->steppers[i].position = track->steppers[i].told;
        track->steppers[i].ticks.reserve(1 << 14);
        track->steppers[i].directions.reserve(1 << 14);
      }
    }
    tracks_.push_back(std::move(track));
  }
  for (Board* board : boards_) {
    ears_.push_back(std::make_unique<Ear>(*this, *board));
    board->listen(ears_.back().get());
  }
  due_ = 0;
}

BoardPort::~BoardPort() {
  for (Board* board : boards_) board->listen(nullptr);
}

void BoardPort::begin(std::size_t channel, const Manner& manner) {
  tracks_[channel]->still = manner.still;
}

std::size_t BoardPort::indexOf(const Board& board) const {
  const auto found = std::find(boards_.begin(), boards_.end(), &board);
  return static_cast<std::size_t>(found - boards_.begin());
}

// ---- boards that come back ----

void BoardPort::prepare(Board& board) {
  for (const auto& track : tracks_) {
    if (track->config.board != &board) continue;
    // A board that was never without power may still play.
    board.send(Command::kTrsyncTrigger, {track->config.trsync, kTakenBack});
    disarm(*track);
    for (std::size_t i = 0; i < track->steppers.size(); ++i) {
      const Heard position = board.ask(Command::kStepperGetPosition, {track->config.motors[i].oid},
                                       Answer::kStepperPosition);
      track->steppers[i].resumes_at = static_cast<std::int32_t>(position.arguments[1]);
    }
  }
}

// Whether the board works. It may have come back since this was asked last.
bool BoardPort::isUsable(Board& board) {
  const std::size_t index = indexOf(board);
  usable_[index] = board.failure() == 0 ? 1 : 0;
  if (usable_[index] != 0 && board.resumed() != resumed_[index]) takeOver(board);
  return usable_[index] != 0;
}

// The same without a board that comes back in the middle of a pass.
bool BoardPort::works(const Board& board) const {
  return usable_[indexOf(board)] != 0 && board.failure() == 0;
}

void BoardPort::takeOver(Board& board) {
  const std::size_t index = indexOf(board);
  resumed_[index] = board.resumed();
  entries_[index] = 0;
  said_[index] = 0;
  board.listen(ears_[index].get());
  for (const auto& track : tracks_) {
    if (track->config.board != &board) continue;
    track->stepped = false;
    for (Track::Stepper& stepper : track->steppers) {
      stepper.entries.clear();
      stepper.told = stepper.position = stepper.resumes_at;
    }
  }
}

// ---- steps on their way to the board ----

// The earliest tick at which the chip takes a step: the firmware would push an earlier one back.
std::int64_t BoardPort::closestTick(const Track& track, int direction) const {
  const Board& board = *track.config.board;
  const bool turns = direction != track.last_direction;
  // Both steps may be played a little off their times.
  return track.last_tick + track.config.pulse_ticks +
         board.ticksOf(turns ? std::max(track.config.low, track.config.turn) : track.config.low) +
         2 * track.error;
}

void BoardPort::put(const Step& step) {
  Track& track = *tracks_[step.channel];
  Lane& lane = lanes_[step.channel];
  lane.last = lane.takes = step.time;
  lane.stepped = true;
  Board& board = *track.config.board;
  track.is_lost = track.is_lost || !isUsable(board);
  if (track.is_lost) {
    track.open.push_back({0, step.direction, step.still});
    due_ = clock_.now();
    return;
  }
  BoardClock& board_clock = board.boardClock();
  const bool is_first = track.open.empty();
  if (is_first && std::all_of(tracks_.begin(), tracks_.end(),
                              [](const auto& other) { return other->open.empty(); })) {
    for (Board* each : boards_) {
      if (isUsable(*each)) each->boardClock().settle();
    }
  }
  std::int64_t tick = board_clock.tickAt(step.time);
  const Nanoseconds now = clock_.now();
  if (is_first) {
    tick = std::max(tick, board_clock.estimateAt(now + kLead + board_clock.uncertainty()));
    track.moved = now;
  }
  if (track.stepped) tick = std::max(tick, closestTick(track, step.direction));
  track.last_tick = tick;
  track.last_direction = step.direction;
  track.stepped = true;
  const MotorSet still = step.still | track.still;
  track.open.push_back({tick, step.direction, still});
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    if ((still & pulse::motorBit(i)) != 0) continue;
    track.steppers[i].ticks.push_back(tick);
    track.steppers[i].directions.push_back(step.direction);
  }
  due_ = std::min(due_, std::max(now, step.time - sentAhead()));
}

void BoardPort::flush(std::size_t channel, Nanoseconds now) {
  Track& track = *tracks_[channel];
  if (track.stopping || track.open.empty()) return;
  BoardClock& board_clock = track.config.board->boardClock();
  const std::int64_t soon = board_clock.estimateAt(now + sentAhead());
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    const Track::Stepper& stepper = track.steppers[i];
    if (stepper.first == stepper.ticks.size() || stepper.ticks[stepper.first] > soon) continue;
    if (flushMotor(track, i, now)) continue;
    // The board has no steps left: whatever is sent now comes too late.
    track.fails = true;
    track.error_number = ETIME;
    return stop(channel, now);
  }
}

bool BoardPort::flushMotor(Track& track, std::size_t motor, Nanoseconds now) {
  Track::Stepper& stepper = track.steppers[motor];
  const Motor& config = track.config.motors[motor];
  Board& board = *track.config.board;
  BoardClock& board_clock = board.boardClock();
  const std::int64_t board_now = board_clock.estimateAt(now);
  const std::int64_t soonest =
      board_clock.estimateAt(now + kMillisecond + board_clock.uncertainty());
  std::size_t& entries = entriesOf(board);
  while (!stepper.entries.empty() && stepper.entries.front() < board_now) {
    stepper.entries.pop_front();
    --entries;
  }
  while (stepper.first != stepper.ticks.size()) {
    const std::int64_t* ticks = stepper.ticks.data() + stepper.first;
    if (*ticks < soonest) return false;
    if (entries + kSpareEntries >= board.moveCount()) break;
    const int direction = stepper.directions[stepper.first];
    std::size_t count = 1;
    while (stepper.first + count != stepper.ticks.size() &&
           stepper.directions[stepper.first + count] == direction) {
      ++count;
    }
    if (!track.armed || track.armed_for != direction) {
      // A time that is over would be a fault of the firmware, and the line may have to repeat it.
      const std::int64_t shortly_before = *ticks - board.ticksOf(kMillisecond);
      arm(track, direction, std::max(soonest, stepper.is_reset ? stepper.last : shortly_before));
    }
    if (!stepper.is_reset) {
      stepper.is_reset = true;
      stepper.dir = false;  // where a stop leaves it
      stepper.last = board_now;
      board.send(Command::kResetStepClock, {config.oid, static_cast<std::uint32_t>(board_now)});
    }
    const bool level = (direction > 0) == config.forward_level;
    if (level != stepper.dir) {
      board.send(Command::kSetNextStepDir, {config.oid, level ? 1U : 0U});
      stepper.dir = level;
    }
    StepRun run;
    std::size_t steps = track.compressor->next(stepper.last, ticks, count, run);
    if (!plays(run, stepper.last, ticks, track.error)) {
      steps = 1;
      run = {static_cast<std::uint32_t>(*ticks - stepper.last), 1, 0};
    }
    board.send(Command::kQueueStep, {config.oid, run.interval, run.count,
                                     static_cast<std::uint32_t>(std::int32_t{run.add})});
    track.sent = true;
    stepper.entries.push_back(*ticks);
    ++entries;
    stepper.last = steps == 1 ? *ticks : tickOf(run, stepper.last, run.count);
    stepper.first += steps;
  }
  if (stepper.first == stepper.ticks.size()) {
    stepper.ticks.clear();
    stepper.directions.clear();
    stepper.first = 0;
  }
  return true;
}

// ---- switches ----

void BoardPort::arm(Track& track, int direction, std::int64_t from) {
  Board& board = *track.config.board;
  const auto home = [&](const Switch& watched) {
    board.send(
        Command::kEndstopHome,
        {watched.oid, static_cast<std::uint32_t>(from), board.ticksOf(kSample), kSamples,
         board.ticksOf(kRest), watched.active ? 1U : 0U, track.config.trsync,
         kFirstSwitch + static_cast<std::uint32_t>(&watched - track.config.switches.data())});
  };
  if (!track.armed) {
    board.send(Command::kTrsyncStart, {track.config.trsync, 0, 0, 0});
    for (const Motor& motor : track.config.motors) {
      board.send(Command::kStepperStopOnTrigger, {motor.oid, track.config.trsync});
    }
  }
  const bool from_rest = !track.armed || track.armed_for == 0;
  for (const Switch& watched : track.config.switches) {
    const bool any = watched.direction == 0 && from_rest;
    if (any || watched.direction == direction) home(watched);
  }
  // The steps towards the other end are still to be played.
  if (!from_rest) track.disarms_other = from;
  track.armed = true;
  track.armed_for = direction;
}

void BoardPort::disarm(Track& track) {
  Board& board = *track.config.board;
  for (const Switch& watched : track.config.switches) {
    board.send(Command::kEndstopHome, {watched.oid, 0, 0, 0, 0, 0, track.config.trsync, 0});
  }
  track.armed_for = 0;
  track.disarms_other.reset();
}

// ---- stops, and what was played ----

void BoardPort::takeBack(std::size_t channel) {
  Track& track = *tracks_[channel];
  if (track.open.empty() || track.stopping) return;
  stop(channel, clock_.now());
}

void BoardPort::stop(std::size_t channel, Nanoseconds now) {
  Track& track = *tracks_[channel];
  Board& board = *track.config.board;
  track.stopping = true;
  for (Track::Stepper& stepper : track.steppers) {
    stepper.ticks.clear();
    stepper.directions.clear();
    stepper.first = 0;
  }
  if (!works(board)) return;
  // If the motors were never told to step, their positions are known all the same.
  board.send(Command::kTrsyncTrigger, {track.config.trsync, kTakenBack});
  askPositions(track, now);
  due_ = std::min(due_, now);
}

void BoardPort::askPositions(Track& track, Nanoseconds now) {
  // Its own time, shortly before it says where the motors stand.
  track.config.board->send(Command::kGetUptime, {});
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    track.steppers[i].is_new = false;
    track.config.board->send(Command::kStepperGetPosition, {track.config.motors[i].oid});
  }
  track.asked = now;
  track.awaits = true;
}

void BoardPort::heard(Board& board, const Heard& heard, Nanoseconds now) {
  if (heard.answer == Answer::kUptime) {
    said_[indexOf(board)] = board.boardClock().widened(heard.arguments[1], now);
    return;
  }
  const std::uint32_t oid = heard.arguments[0];
  for (std::size_t channel = 0; channel < tracks_.size(); ++channel) {
    Track& track = *tracks_[channel];
    if (track.config.board != &board) continue;
    if (heard.answer == Answer::kTrsyncState && oid == track.config.trsync) {
      if (heard.arguments[1] != 0) return;
      if (track.has_stopped || !(track.armed || track.stopping)) return;
      if (!track.stopping && !track.sent) {
        // It has made all of its steps before: the next ones begin anew.
        for (Track::Stepper& stepper : track.steppers) stepper.is_reset = false;
        track.armed = false;
        return;
      }
      track.has_stopped = true;
      track.stopped_by = track.armed ? heard.arguments[2] : kTakenBack;
      if (!track.stopping) {
        stop(channel, now);
      } else {
        // Answers that were on their way are of before the stop.
        for (Track::Stepper& stepper : track.steppers) stepper.is_new = false;
      }
      return;
    }
    if (heard.answer != Answer::kStepperPosition) continue;
    for (std::size_t i = 0; i < track.steppers.size(); ++i) {
      if (track.config.motors[i].oid != oid) continue;
      track.steppers[i].position = static_cast<std::int32_t>(heard.arguments[1]);
      track.steppers[i].is_new = true;
      const bool all_new = std::all_of(track.steppers.begin(), track.steppers.end(),
                                       [](const auto& stepper) { return stepper.is_new; });
      if (!all_new) return;
      track.awaits = false;
      if (track.stopping) {
        if (track.has_stopped) settle(channel, now);
      } else {
        tellPlayed(channel, now);
      }
      return;
    }
  }
  hears_(board, heard, now);
}

// How many of the open steps a motor has made by what it has said. A motor that goes back and forth
// is at a place several times: the earliest time counts that isn't before `least`, so that what is
// played later still fits. Only a motor that its board has stopped was there before.
std::size_t BoardPort::playedBy(const Track& track, std::size_t motor, const Window& window,
                                bool& fits) const {
  const Track::Stepper& stepper = track.steppers[motor];
  const int sign = track.config.motors[motor].forward_level ? 1 : -1;
  std::int64_t position = stepper.told;
  std::size_t played = 0;
  fits = false;
  for (std::size_t i = 0;; ++i) {
    const bool is_last = i == track.open.size();
    if (position == stepper.position) {
      fits = true;
      played = i;
      if (is_last || track.open[i].tick > window.least) return played;
    }
    if (is_last || track.open[i].tick > window.most) return played;
    const Open& step = track.open[i];
    if ((step.still & pulse::motorBit(motor)) == 0) position += std::int64_t{sign} * step.direction;
  }
}

// No step after this can have been played by now: only a motor that goes back and forth needs that.
std::int64_t BoardPort::latestTick(const Track& track, Nanoseconds now) const {
  constexpr int kDeviations = 3;
  const BoardClock& board_clock = track.config.board->boardClock();
  const std::int64_t tick =
      board_clock.estimateAt(now + kMillisecond + kDeviations * board_clock.uncertaintyAt(now));
  return std::max(tick, said_[indexOf(*track.config.board)]);
}

// Each step until this has been played when the board said where its motors stand, unless it had
// stopped them.
std::int64_t BoardPort::earliestTick(const Track& track) const {
  const Board& board = *track.config.board;
  return said_[indexOf(board)] - board.ticksOf(kMillisecond);
}

void BoardPort::tellPlayed(std::size_t channel, Nanoseconds now) {
  Track& track = *tracks_[channel];
  const Window window{earliestTick(track), latestTick(track, now)};
  std::size_t played = track.open.size();
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    bool fits = false;
    played = std::min(played, playedBy(track, i, window, fits));
    if (!fits) return failChannel(channel, EPROTO, now);
  }
  if (played != 0) {
    close(channel, played, now);
    track.moved = now;
    return;
  }
  // Steps were due long before it was asked, and it hasn't made them: its board has stopped it, and
  // nobody has heard that.
  const Board& board = *track.config.board;
  const bool is_due = !track.open.empty() &&
                      track.open.front().tick < said_[indexOf(board)] - board.ticksOf(kStalled);
  if (!is_due || now - track.moved <= kStalled) return;
  track.has_stalled = true;
  stop(channel, now);
}

void BoardPort::close(std::size_t channel, std::size_t played, Nanoseconds now) {
  Track& track = *tracks_[channel];
  const BoardClock& board_clock = track.config.board->boardClock();
  for (std::size_t i = 0; i < played; ++i) {
    const Open step = track.open.front();
    track.open.pop_front();
    for (std::size_t k = 0; k < track.steppers.size(); ++k) {
      if ((step.still & pulse::motorBit(k)) != 0) continue;
      track.steppers[k].told +=
          track.config.motors[k].forward_level ? step.direction : -step.direction;
    }
    const Nanoseconds time = board_clock.timeOf(step.tick + track.error + 1);
    listener_->played(channel, step.direction, step.still,
                      std::min(now, time + board_clock.uncertaintyAt(time)));
  }
  if (!track.open.empty() || track.stopping) return;
  track.sent = false;
  // A motor at rest isn't watched: its switches may be pressed.
  if (track.armed) disarm(track);
}

// The motors have stopped, and have said where.
void BoardPort::settle(std::size_t channel, Nanoseconds now) {
  Track& track = *tracks_[channel];
  const std::int64_t latest = latestTick(track, now);
  // A switch may have stopped it at any time.
  const bool by_switch = track.stopped_by != kTakenBack;
  const Window window{by_switch ? latest : earliestTick(track), latest};
  std::vector<std::size_t> played(track.steppers.size());
  bool all_fit = true;
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    bool fits = false;
    played[i] = playedBy(track, i, window, fits);
    all_fit = all_fit && fits;
  }
  if (!all_fit) {
    track.fails = true;
    track.error_number = EPROTO;
  }
  const auto [least, most] = std::minmax_element(played.begin(), played.end());
  // A stop may come between the edges of two motors.
  for (std::size_t i = *least; all_fit && i < *most; ++i) {
    for (std::size_t k = 0; k < track.steppers.size(); ++k) {
      if (played[k] <= i) track.open[i].still |= pulse::motorBit(k);
    }
  }
  const std::size_t count = all_fit ? *most : *least;
  close(channel, count, now);
  for (std::size_t i = 0; i < track.steppers.size(); ++i) {
    Track::Stepper& stepper = track.steppers[i];
    stepper.told = stepper.position;
    stepper.is_reset = false;
    entriesOf(*track.config.board) -= stepper.entries.size();
    stepper.entries.clear();
  }
  disarm(track);
  const std::size_t given_back = track.open.size();
  const bool fails = track.fails;
  const bool has_stalled = track.has_stalled;
  const std::uint32_t stopped_by = track.stopped_by;
  track.open.clear();
  track.armed = track.sent = track.stopping = track.has_stopped = track.has_stalled = false;
  track.fails = track.awaits = false;
  track.stopped_by = kTakenBack;
  if (given_back != 0) listener_->givenBack(channel, given_back);
  if (fails) {
    if (!all_fit) listener_->doubtful(channel);
    listener_->failed(channel, {track.error_number, track.config.line}, now);
  } else if (stopped_by >= kFirstSwitch &&
             stopped_by - kFirstSwitch < track.config.switches.size()) {
    const Switch& by = track.config.switches[stopped_by - kFirstSwitch];
    listener_->stopped(channel, {by.reason, channel, by.motor, {}, track.still});
  } else if (stopped_by != kTakenBack || has_stalled) {
    listener_->failed(channel, {EPROTO, track.config.line}, now);
  }
}

// Its board works, and its motors are stopped: they can say where they stand.
void BoardPort::failChannel(std::size_t channel, int error, Nanoseconds now) {
  Track& track = *tracks_[channel];
  track.fails = true;
  track.error_number = error;
  if (!track.stopping) stop(channel, now);
}

// The count isn't known: what is open may have been played or not.
void BoardPort::giveUp(std::size_t channel, int error, Nanoseconds now) {
  Track& track = *tracks_[channel];
  const std::size_t open = track.open.size();
  track.open.clear();
  for (Track::Stepper& stepper : track.steppers) {
    stepper.ticks.clear();
    stepper.directions.clear();
    stepper.first = 0;
    stepper.is_reset = false;
  }
  track.disarms_other.reset();
  track.armed_for = 0;
  track.armed = track.sent = track.stopping = track.has_stopped = track.has_stalled = false;
  track.fails = track.awaits = track.is_lost = false;
  if (open != 0) listener_->givenBack(channel, open);
  if (open != 0) listener_->doubtful(channel);
  listener_->failed(channel, {error, track.config.line}, now);
}

void BoardPort::lost(Board& board, Nanoseconds now) {
  for (std::size_t channel = 0; channel < tracks_.size(); ++channel) {
    if (tracks_[channel]->config.board == &board) giveUp(channel, board.failure(), now);
  }
}

void BoardPort::serve(Nanoseconds now) {
  for (Board* board : boards_) isUsable(*board);
  if (writes_) writes_();
  for (std::size_t channel = 0; channel < tracks_.size(); ++channel) {
    Track& track = *tracks_[channel];
    if (track.config.board == nullptr) continue;
    if (track.is_lost || !works(*track.config.board)) {
      const int error = track.config.board->failure();
      if (!track.open.empty()) giveUp(channel, error != 0 ? error : ENODEV, now);
      continue;
    }
    flush(channel, now);
    if (track.disarms_other &&
        *track.disarms_other < track.config.board->boardClock().estimateAt(now)) {
      for (const Switch& watched : track.config.switches) {
        if (watched.direction != -track.armed_for) continue;
        track.config.board->send(Command::kEndstopHome,
                                 {watched.oid, 0, 0, 0, 0, 0, track.config.trsync, 0});
      }
      track.disarms_other.reset();
    }
    if (track.stopping && now - track.asked >= kAsksAgain) {
      track.config.board->send(Command::kTrsyncTrigger, {track.config.trsync, kTakenBack});
      askPositions(track, now);
    } else if (!track.stopping && !track.open.empty() && now >= positions_due_ &&
               (!track.awaits || now - track.asked >= kAsksAgain)) {
      askPositions(track, now);
    }
  }
  if (now >= positions_due_) positions_due_ = now + kPositions;
  for (Board* board : boards_) {
    if (works(*board)) board->serve(now);
    board->release();
  }
  schedule(now);
}

void BoardPort::schedule(Nanoseconds now) {
  due_ = pulse::kNever;
  for (const Board* board : boards_) {
    if (works(*board)) due_ = std::min(due_, board->due(now));
  }
  for (const auto& track : tracks_) {
    if (track->open.empty() || !works(*track->config.board)) continue;
    due_ = std::min(
        {due_, positions_due_, track->stopping ? track->asked + kAsksAgain : pulse::kNever});
    if (track->stopping) continue;
    for (const Track::Stepper& stepper : track->steppers) {
      if (stepper.first == stepper.ticks.size()) continue;
      const Nanoseconds time =
          track->config.board->boardClock().timeOf(stepper.ticks[stepper.first]);
      // If the board's queue is full, it is tried again each millisecond.
      due_ = std::min(due_, std::max(now + kMillisecond, time - sentAhead()));
    }
  }
}

}  // namespace stepdriver::klipper
