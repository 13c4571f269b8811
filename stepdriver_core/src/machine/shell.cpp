#include "shell.h"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "pulse/realtime.h"
#include "start_thread.h"
#include "steady_now.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr std::int64_t kInputPeriodNs = 100'000'000;
// The same while somebody waits for a missing edge, or may have to.
constexpr std::int64_t kEdgePeriodNs = 5'000'000;
constexpr pulse::Nanoseconds kOften = 1'000'000;
constexpr pulse::Nanoseconds kVirtualInputPeriod = 1'000'000;
// The pulse thread hangs if it makes no progress in a pass from one of so many looks to the next.
// They are counted, because a process that was suspended looks only once.
constexpr std::int64_t kLookPeriodNs = 100'000'000;
constexpr std::int64_t kFewestLooks = 5;
// The rig has locks, whose owners may wait for a processor.
constexpr std::int64_t kFewestLooksOnRig = 30;

activity::Reply refused(const std::string& why) {
  return {activity::Failure{activity::Failure::Kind::kRefused, why}, {}};
}

/// So much later; pulse::kNever if that is too late for a clock.
std::int64_t later(std::int64_t time_ns, std::chrono::nanoseconds by) {
  return by.count() < pulse::kNever - time_ns ? time_ns + by.count() : pulse::kNever;
}

activity::Reply hung(const std::string& why) {
  return {activity::Failure{activity::Failure::Kind::kGpio, why}, {}};
}

/// Whether an axis that was at rest moves now.
bool motionBegins(const MachineSnapshot& before, const MachineSnapshot& now) {
  for (std::size_t i = 0; i < now.axes.size(); ++i) {
    if (now.axes[i].state.moving && !before.axes[i].state.moving) return true;
  }
  return false;
}

}  // namespace

Shell::Shell(Controller& controller, pulse::PulseEngine& engine, pulse::Clock& clock,
             std::shared_ptr<gpio::Lines> lines, const Wiring& wiring, const Options& options)
    : controller_(controller),
      engine_(engine),
      clock_(clock),
      lines_(std::move(lines)),
      has_inputs_(!wiring.inputs.empty()),
      threaded_(options.threaded),
      on_motion_(options.on_motion),
      on_io_(options.on_io),
      most_looks_in_vain_(std::max(clock.realtime() ? kFewestLooks : kFewestLooksOnRig,
                                   options.write_timeout_ns / kLookPeriodNs)),
      writers_(
          lines_, wiring.safeLevels(), options.threaded, options.write_timeout_ns,
          [this] { wakeUp(); },
          [this, recorder = options.recorder](const gpio::LineWrite& write) {
            if (recorder != nullptr) recorder->addWrite(write, clock_.now());
          }),
      core_(controller, engine, clock, lines_, wiring.inputs.size(), *this, options.recorder),
      snapshot_(core_.snapshot()),
      ports_(options.open_port, options.threaded, [this] { wakeUp(); }) {
  engine_.listen(*this);
  if (!threaded_) return;
  try {
    pulse_thread_.emplace(engine_, clock_, this, options.realtime);
    thread_ = startThread([this] { run(); });
    if (has_inputs_) watcher_ = startThread([this] { watchInputs(); });
  } catch (const Error&) {
    stop();  // ends the threads that were started
    throw;
  }
}

Shell::~Shell() { stop(); }

void Shell::stop() {
  if (ending_.exchange(true)) return;
  const std::vector<activity::CallId> open = core_.close();
  wake_.raise();
  lines_->interrupt();
  if (watcher_.joinable()) watcher_.join();
  if (thread_.joinable()) thread_.join();
  if (pulse_thread_) pulse_thread_->stop();
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  for (const activity::CallId call : open) {
    const auto waiting = answers_.find(call);
    if (waiting != answers_.end()) waiting->second.reply = refused("the machine was shut down");
  }
  ++changes_;
  answered_.notify_all();
}

pulse::RealtimeRights Shell::rights() const {
  return pulse_thread_ ? pulse_thread_->rights() : pulse::RealtimeRights{-1, -1, -1};
}

// ---- clients ----

activity::Reply Shell::call(Request request) {
  if (const std::string why = whyHung(); !why.empty()) return hung(why);
  const activity::CallId id = ++calls_;
  {
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    answers_[id];
  }
  if (const std::string why = core_.post(id, std::move(request)); !why.empty()) {
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    answers_.erase(id);
    return refused(why);
  }
  wakeUp();
  std::optional<activity::Reply> reply;
  try {
    wait([&] {
      const std::lock_guard<std::mutex> lock(answers_mutex_);
      reply = answers_[id].reply;
      return reply.has_value();
    });
  } catch (const GpioError& error) {
    reply = hung(error.what());
  }
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  answers_.erase(id);
  return *std::move(reply);
}

void Shell::wait(const std::function<bool()>& ready, bool often) {
  Patience patience;
  patience.often = often;
  await(ready, patience);
}

bool Shell::waitFor(const std::function<bool()>& ready, std::chrono::nanoseconds longest) {
  Patience patience;
  patience.longest = longest;
  patience.reads_inputs = true;
  return await(ready, patience);
}

bool Shell::await(const std::function<bool()>& ready, const Patience& patience) {
  return threaded_ ? awaitThreads(ready, patience) : pump(ready, patience);
}

bool Shell::awaitThreads(const std::function<bool()>& ready, const Patience& patience) {
  const std::int64_t end = later(steadyNow(), patience.longest);
  std::unique_lock<std::mutex> lock(answers_mutex_);
  for (;;) {
    const std::uint64_t changes = changes_;
    lock.unlock();
    if (ready()) return true;
    lock.lock();
    if (!why_hung_.empty()) throw GpioError(why_hung_);
    if (end != pulse::kNever && steadyNow() >= end) return false;
    const std::int64_t until = patience.often ? std::min(end, steadyNow() + kOften) : end;
    const auto another = [&] { return changes_ != changes; };
    if (until == pulse::kNever) {
      answered_.wait(lock, another);
    } else {
      answered_.wait_until(
          lock, std::chrono::steady_clock::time_point(std::chrono::nanoseconds(until)), another);
    }
  }
}

bool Shell::pump(const std::function<bool()>& ready, const Patience& patience) {
  const pulse::Nanoseconds end = later(clock_.now(), patience.longest);
  pulse::Nanoseconds next_reading = patience.reads_inputs ? clock_.now() : pulse::kNever;
  for (;;) {
    if (clock_.now() >= next_reading) {
      engine_.inputsChanged();  // nothing watches them
      feedInputs();
      next_reading = clock_.now() + kVirtualInputPeriod;
    }
    settle();
    const std::uint64_t changes = changes_;
    if (ready()) return true;
    if (changes != changes_) continue;  // it has made a request itself
    if (clock_.now() >= end) return false;
    const pulse::Nanoseconds due = std::min({engine_due_, core_.due(), core_.edgesDue(), end});
    if (due == pulse::kNever) throw Error("nothing is under way that could end this wait");
    const pulse::Nanoseconds next_look = patience.often ? clock_.now() + kOften : pulse::kNever;
    clock_.waitUntil(std::min({due, core_.dueWithPolls(), next_look, next_reading}));
  }
}

void Shell::awaitTurn() {
  std::unique_lock<std::mutex> lock(answers_mutex_);
  answered_.wait(lock, [this, begun = core_.turnsBegun()] { return turns_ended_ >= begun; });
}

std::string Shell::whyHung() const {
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  return why_hung_;
}

void Shell::advance(pulse::Nanoseconds time) {
  // The clock serves one waiting thread; with two, its time could stand still for good.
  if (threaded_) throw Refused("advance() is only for a machine without threads");
  engine_.inputsChanged();  // nothing watches them
  feedInputs();
  const pulse::Nanoseconds end = clock_.now() + time;
  for (;;) {
    settle();
    const pulse::Nanoseconds due = std::min({engine_due_, core_.dueWithPolls(), core_.edgesDue()});
    if (due > end && clock_.now() >= end) return;
    clock_.waitUntil(std::min(due, end));
  }
}

std::shared_ptr<const MachineSnapshot> Shell::snapshot() const {
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  return snapshot_;
}

axis::AxisState Shell::state(AxisId axis) const {
  const auto motion_now = [this] { return clock_.now() - engine_.state().slipped; };
  const pulse::Nanoseconds before = motion_now();
  const std::shared_ptr<const MachineSnapshot> seen = snapshot();
  const pulse::ChannelState live = engine_.channel(static_cast<int>(axis));
  return stateOf(seen->axes.at(axis), live, before, motion_now());
}

double Shell::peakRate(AxisId axis) const {
  return peakRateOf(snapshot()->axes.at(axis), engine_.channel(static_cast<int>(axis)));
}

// ---- events ----

// A virtual clock stands still until the news has been handled.
void Shell::onNews() noexcept {
  core_.noteNews();
  if (!threaded_) return;
  if (!news_hold_.exchange(true)) clock_.hold();
  wake_.raise();
}

void Shell::wakeUp() { wake_.raise(); }

bool Shell::responds(std::chrono::nanoseconds longest) {
  if (!threaded_) return true;
  std::unique_lock<std::mutex> lock(rounds_mutex_);
  const std::uint64_t rounds = rounds_;
  wake_.raise();
  return round_ended_.wait_for(lock, longest, [&] { return ending_ || rounds_ != rounds; });
}

// An edge is only a wake-up: the levels are read. Periodic reading makes up for a lost edge, or one
// that came while a chip was waking up.
void Shell::watchInputs() {
  pthread_setname_np(pthread_self(), "inputs");
  std::int64_t read_at = steadyNow();
  while (!ending_) {
    std::array<gpio::EdgeEvent, 16> edges{};
    const pulse::Nanoseconds asked = clock_.now();
    const std::int64_t period = core_.watchesInputs() ? kEdgePeriodNs : kInputPeriodNs;
    const int count = lines_->waitForEdges(period, edges.data(), edges.size());
    const bool must_read = steadyNow() >= read_at + kInputPeriodNs || asked >= core_.edgesDue();
    if (count == 0 && !must_read) continue;
    read_at = steadyNow();
    engine_.inputsChanged();
    if (core_.watchInputs(edges.data(), count, asked)) wake_.raise();
    // If waiting fails, reading will fail too, and report it.
    if (count < 0) std::this_thread::sleep_for(std::chrono::nanoseconds(kInputPeriodNs));
  }
}

// ---- the thread of the controller ----

void Shell::run() {
  pthread_setname_np(pthread_self(), "controller");
  // Without that right it works too, and a stop may wait for a processor.
  if (clock_.keepsRealTime()) pulse::askForScheduler(pulse::kPromptPriority);
  bool holding = false;
  for (;;) {
    std::int64_t until = writers_.deadline().value_or(pulse::kNever);
    if (clock_.realtime()) until = std::min(until, core_.dueWithPolls());
    if (mustWatchPulses()) until = std::min(until, next_look_ns_);
    if (!beginRound()) break;
    wake_.wait(until);
    if (ending_) break;
    if (!holding) clock_.hold();
    holding = true;
    if (news_hold_.exchange(false)) clock_.release();
    while (turn()) {
    }
    watchPulses();
    if (!clock_.realtime()) pulse_thread_->setAlarm(alarm());
    // Time stands still until the engine has accepted the orders and the lines are written.
    if (!core_.ordersAreOpen() && writers_.idle() && ports_.idle()) {
      clock_.release();
      holding = false;
    }
  }
  if (holding) clock_.release();
  if (news_hold_.exchange(false)) clock_.release();
}

// @return whether there is another one.
bool Shell::beginRound() {
  const std::lock_guard<std::mutex> lock(rounds_mutex_);
  ++rounds_;
  round_ended_.notify_all();
  return !ending_;
}

// Whether the pulse thread has anything to do for which somebody may wait.
bool Shell::mustWatchPulses() const {
  if (core_.ordersAreOpen() || engine_.stopsAsked() != engine_.stopsServed()) return true;
  const auto moves = [](const AxisSnapshot& axis) { return axis.state.moving; };
  return std::any_of(snapshot_->axes.begin(), snapshot_->axes.end(), moves);
}

void Shell::watchPulses() {
  const std::int64_t now = steadyNow();
  const std::uint64_t passes = pulse_thread_->passes();
  const bool progresses = passes % 2 == 0 || passes != passes_seen_;
  passes_seen_ = passes;
  if (progresses) {
    looks_in_vain_ = 0;
    next_look_ns_ = now + kLookPeriodNs;
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    why_hung_.clear();
    return;
  }
  if (now < next_look_ns_) return;
  next_look_ns_ = now + kLookPeriodNs;
  // On a computer without enough time it may only wait for a processor.
  if (!pulse_thread_->isBlocked()) looks_in_vain_ = 0;
  if (++looks_in_vain_ != most_looks_in_vain_) return;
  // When the chip answers again, the motions don't continue.
  engine_.stopAtOnce();
  const pulse::LineFailure line = engine_.lineAtWork();
  const std::string why = controller_.textOf(line);
  {
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    why_hung_ = why;
  }
  core_.handle(EngineHangs{line});
}

// When virtual time must stand still for the controller. The thread that watches the inputs takes
// real time, in which virtual time could run far past the change of a switch. Polls of driver chips
// alone don't move a clock that stands still while nothing happens: it would never rest.
pulse::Nanoseconds Shell::alarm() const {
  const bool time_passes =
      clock_.passesByItself() || core_.due() != pulse::kNever || mustWatchPulses();
  const pulse::Nanoseconds due =
      std::min(time_passes ? core_.dueWithPolls() : core_.due(), core_.edgesDue());
  return core_.watchesInputs() ? std::min(due, clock_.now() + kVirtualInputPeriod) : due;
}

// Without threads. This runs for each edge, and few edges concern the controller.
void Shell::settle() {
  bool fed = false;
  do {
    if (isAwaited()) {
      while (turn()) {
      }
    }
    engine_due_ = engine_.serve();
    fed = core_.watchesInputs() && feedInputs();
  } while (fed || core_.hasNews() || core_.hasInput());
}

// Whether there may be anything to do in a turn.
bool Shell::isAwaited() {
  return wake_.consume() || core_.hasNews() || clock_.now() >= core_.dueWithPolls() ||
         core_.hasInput();
}

// @return whether the controller was told anything.
bool Shell::feedInputs() {
  if (!has_inputs_) return false;
  std::array<gpio::EdgeEvent, 16> edges{};
  for (int count = 1; count > 0;) {
    const pulse::Nanoseconds asked = clock_.now();
    count = lines_->waitForEdges(0, edges.data(), edges.size());
    core_.watchInputs(edges.data(), count, asked);
  }
  bool fed = false;
  while (core_.takeInput()) fed = true;
  return fed;
}

// @return whether there was anything to do.
bool Shell::turn() {
  bool any = core_.takeNews();
  for (const gpio::LineWriters::Done& done : writers_.collect()) {
    core_.handle(activity::PinDone{done.id, done.error});
    any = true;
  }
  for (bus::RegisterDone& done : ports_.collect()) {
    core_.handle(std::move(done));
    any = true;
  }
  while (core_.takeInput()) {
  }
  if (threaded_ && !clock_.realtime() && core_.watchesInputs()) feedInputs();
  any = core_.takeRequest() || any;
  return core_.takeTime() || any;
}

void Shell::turnEnded(const MachineSnapshot& before,
                      const std::shared_ptr<const MachineSnapshot>& now, activity::Outputs& out) {
  {
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    snapshot_ = now;
    for (auto& [call, reply] : out.answers) {
      const auto waiting = answers_.find(call);
      if (waiting != answers_.end()) waiting->second.reply = std::move(reply);
    }
    ++changes_;
    ++turns_ended_;
  }
  answered_.notify_all();
  if (on_motion_ && motionBegins(before, *now)) on_motion_();
  if (on_io_ && now->io != before.io) on_io_(*now->io);
}

void Shell::write(const activity::PinJob& job) {
  writers_.write(job.id, {job.output, job.level, job.part});
}

void Shell::access(const bus::RegisterJob& job) { ports_.begin(job); }

}  // namespace stepdriver::machine
