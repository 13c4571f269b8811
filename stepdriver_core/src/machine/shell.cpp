#include "shell.h"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <system_error>
#include <utility>

#include "pulse/realtime.h"
#include "steady_now.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr std::int64_t kInputPeriodNs = 100'000'000;
constexpr pulse::Nanoseconds kOften = 1'000'000;
constexpr pulse::Nanoseconds kVirtualInputPeriod = 1'000'000;
constexpr std::size_t kMostRequests = 256;
// The pulse thread hangs if it makes no progress in a pass from one of so many looks to the next.
// They are counted, because a process that was suspended looks only once.
constexpr std::int64_t kLookPeriodNs = 100'000'000;
constexpr std::int64_t kFewestLooks = 5;
// The rig has locks, whose owners may wait for a processor.
constexpr std::int64_t kFewestLooksOnRig = 30;

/// Requests that may be refused because of the level of a switch. Their callers read the inputs
/// again, so that a switch that was just pressed counts.
bool asksForLevels(const Request& request) {
  return std::holds_alternative<MoveTo>(request) || std::holds_alternative<MoveRounds>(request) ||
         std::holds_alternative<PlanMove>(request) || std::holds_alternative<Jog>(request) ||
         std::holds_alternative<JogTogether>(request) ||
         std::holds_alternative<FollowSetpoints>(request) ||
         std::holds_alternative<MoveLine>(request) || std::holds_alternative<Resume>(request) ||
         std::holds_alternative<Home>(request) || std::holds_alternative<SetMicrosteps>(request) ||
         std::holds_alternative<Recover>(request);
}

std::chrono::steady_clock::time_point steadyTime(std::int64_t time_ns) {
  return std::chrono::steady_clock::time_point(std::chrono::nanoseconds(time_ns));
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
             std::shared_ptr<gpio::Lines> lines, std::size_t inputs, const Options& options)
    : controller_(controller),
      engine_(engine),
      clock_(clock),
      lines_(std::move(lines)),
      inputs_(static_cast<int>(inputs)),
      threaded_(options.threaded),
      on_motion_(options.on_motion),
      most_looks_in_vain_(std::max(clock.realtime() ? kFewestLooks : kFewestLooksOnRig,
                                   options.write_timeout_ns / kLookPeriodNs)),
      recorder_(options.recorder),
      writers_(
          lines_, options.threaded, options.write_timeout_ns, [this] { wakeUp(); },
          [this](const gpio::LineWrite& write) {
            if (recorder_ != nullptr) recorder_->addWrite(write, clock_.now());
          }),
      told_levels_(inputs),
      snapshot_(controller.snapshot()),
      posted_(engine.channels()),
      due_(controller.due()),
      watches_(controller.watchesInputs()) {
  engine_.listen(*this);
  queue(readInputs());
  if (!threaded_) return;
  try {
    pulse_thread_.emplace(engine_, clock_, this, options.realtime);
    thread_ = std::thread([this] { run(); });
    if (inputs_ > 0) watcher_ = std::thread([this] { watchInputs(); });
  } catch (const std::system_error&) {
    stop();  // ends the threads that were started
    throw;
  }
}

Shell::~Shell() { stop(); }

void Shell::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (ending_) return;
    ending_ = true;
  }
  wake_.notify_all();
  lines_->interrupt();
  if (watcher_.joinable()) watcher_.join();
  if (thread_.joinable()) thread_.join();
  if (pulse_thread_) pulse_thread_->stop();
  for (const Item& item : std::exchange(requests_, {})) {
    answer(item.call,
           {activity::Failure{activity::Failure::Kind::kRefused, "the machine was shut down"}, {}});
  }
}

pulse::RealtimeRights Shell::rights() const {
  return pulse_thread_ ? pulse_thread_->rights() : pulse::RealtimeRights{-1, -1, -1};
}

// ---- clients ----

activity::Reply Shell::call(Request request) {
  if (const std::string why = whyHung(); !why.empty()) return hung(why);
  std::optional<InputReading> reading;
  if (asksForLevels(request)) reading = readInputs();
  activity::CallId id = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const char* why = ending_                             ? "the machine was shut down"
                      : requests_.size() >= kMostRequests ? "too many requests are already waiting"
                                                          : nullptr;
    if (why != nullptr) return {activity::Failure{activity::Failure::Kind::kRefused, why}, {}};
    id = ++calls_;
    {
      const std::lock_guard<std::mutex> answers_lock(answers_mutex_);
      answers_[id];
    }
    if (reading) queue(*reading);
    requests_.push_back({id, std::move(request)});
    woken_ = true;
  }
  wake_.notify_one();
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
  if (threaded_) {
    std::unique_lock<std::mutex> lock(answers_mutex_);
    for (;;) {
      const std::uint64_t turns = turns_;
      lock.unlock();
      if (ready()) return;
      lock.lock();
      if (!why_hung_.empty()) throw GpioError(why_hung_);
      const auto another = [&] { return turns_ != turns; };
      if (often) {
        answered_.wait_for(lock, std::chrono::nanoseconds(kOften), another);
      } else {
        answered_.wait(lock, another);
      }
    }
  }
  for (;;) {
    settle();
    const std::uint64_t turns = turns_;
    if (ready()) return;
    if (turns != turns_) continue;  // it has made a request itself
    const pulse::Nanoseconds due = std::min(engine_due_, due_);
    if (due == pulse::kNever) throw Error("nothing is under way that could end this wait");
    clock_.waitUntil(often ? std::min(due, clock_.now() + kOften) : due);
  }
}

void Shell::awaitTurn() {
  std::unique_lock<std::mutex> lock(answers_mutex_);
  answered_.wait(lock, [this, begun = turns_begun_.load()] { return turns_ended_ >= begun; });
}

std::string Shell::whyHung() const {
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  return why_hung_;
}

void Shell::advance(pulse::Nanoseconds time) {
  engine_.inputsChanged();  // nothing watches them
  feedInputs();
  const pulse::Nanoseconds end = clock_.now() + time;
  for (;;) {
    settle();
    const pulse::Nanoseconds due = std::min(engine_due_, due_);
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

void Shell::answer(activity::CallId call, activity::Reply reply) {
  const std::lock_guard<std::mutex> lock(answers_mutex_);
  const auto waiting = answers_.find(call);
  if (waiting != answers_.end()) waiting->second.reply = std::move(reply);
  ++turns_;
  answered_.notify_all();
}

// ---- events ----

// A virtual clock stands still until the news has been handled.
void Shell::onNews() noexcept {
  news_.store(true, std::memory_order_release);
  if (!threaded_) return;
  if (!news_hold_.exchange(true)) clock_.hold();
  wakeUp();
}

void Shell::wakeUp() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_ = true;
  }
  wake_.notify_one();
}

bool Shell::responds(std::chrono::nanoseconds longest) {
  if (!threaded_) return true;
  std::unique_lock<std::mutex> lock(mutex_);
  const std::uint64_t rounds = rounds_;
  woken_ = true;
  wake_.notify_one();
  return round_ended_.wait_for(lock, longest, [&] { return ending_ || rounds_ != rounds; });
}

InputReading Shell::readInputs() {
  InputReading reading{++readings_, {}};
  reading.levels.reserve(static_cast<std::size_t>(inputs_));
  for (int input = 0; input < inputs_; ++input) reading.levels.push_back(lines_->read(input));
  return reading;
}

bool Shell::queue(const InputReading& reading) {
  const std::vector<InputRead> changed = told_levels_.differences(reading);
  reads_.insert(reads_.end(), changed.begin(), changed.end());
  return !changed.empty();
}

// An edge is only a wake-up: the levels are read. Periodic reading makes up for a lost edge, or one
// that came while a chip was waking up.
void Shell::watchInputs() {
  pthread_setname_np(pthread_self(), "inputs");
  for (;;) {
    std::array<gpio::EdgeEvent, 16> events{};
    const int count = lines_->waitForEdges(kInputPeriodNs, events.data(), events.size());
    engine_.inputsChanged();
    const InputReading reading = readInputs();
    bool changed = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (ending_) return;
      for (int i = 0; i < count; ++i) edges_.push_back(events.at(static_cast<std::size_t>(i)));
      changed = queue(reading);
    }
    if (changed || count > 0) wakeUp();
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
    if (clock_.realtime()) until = std::min(until, due_);
    if (mustWatchPulses()) until = std::min(until, next_look_ns_);
    {
      std::unique_lock<std::mutex> lock(mutex_);
      ++rounds_;
      round_ended_.notify_all();
      const auto ready = [this] { return woken_ || ending_; };
      if (until == pulse::kNever) {
        wake_.wait(lock, ready);
      } else {
        wake_.wait_until(lock, steadyTime(until), ready);
      }
      if (ending_) break;
      woken_ = false;
    }
    if (!holding) clock_.hold();
    holding = true;
    if (news_hold_.exchange(false)) clock_.release();
    while (turn()) {
    }
    watchPulses();
    if (!clock_.realtime()) pulse_thread_->setAlarm(alarm());
    // Time stands still until the engine has accepted the orders and the lines are written.
    if (!ordersAreOpen() && writers_.idle()) {
      clock_.release();
      holding = false;
    }
  }
  if (holding) clock_.release();
  if (news_hold_.exchange(false)) clock_.release();
}

// Whether the pulse thread has anything to do for which somebody may wait.
bool Shell::mustWatchPulses() const {
  if (ordersAreOpen() || engine_.stopsAsked() != engine_.stopsServed()) return true;
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
  handle(EngineHangs{line});
}

// When virtual time must stand still for the controller. The thread that watches the inputs takes
// real time, in which virtual time could run far past the change of a switch.
pulse::Nanoseconds Shell::alarm() const {
  return watches_ ? std::min(due_, clock_.now() + kVirtualInputPeriod) : due_;
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
    fed = watches_ && feedInputs();
  } while (fed || news_.load(std::memory_order_acquire) || !reads_.empty());
}

// Whether there may be anything to do in a turn.
bool Shell::isAwaited() {
  if (news_.load(std::memory_order_acquire) || clock_.now() >= due_) return true;
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(woken_, false) || !reads_.empty();
}

// @return whether the controller was told anything.
bool Shell::feedInputs() {
  if (inputs_ == 0) return false;
  bool fed = false;
  std::array<gpio::EdgeEvent, 16> events{};
  for (int count = 1; count > 0;) {
    count = lines_->waitForEdges(0, events.data(), events.size());
    for (int i = 0; i < count; ++i) handle(InputEdge{events.at(static_cast<std::size_t>(i))});
    fed = fed || count > 0;
  }
  const InputReading reading = readInputs();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    queue(reading);
  }
  return feedWhatIsWatched() || fed;
}

bool Shell::feedWhatIsWatched() {
  std::vector<InputRead> reads;
  std::vector<gpio::EdgeEvent> edges;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    reads.swap(reads_);
    edges.swap(edges_);
  }
  for (const gpio::EdgeEvent& edge : edges) handle(InputEdge{edge});
  for (const InputRead& read : reads) handle(read);
  return !edges.empty() || !reads.empty();
}

// @return whether there was anything to do.
bool Shell::turn() {
  bool any = takeNews();
  for (const gpio::LineWriters::Done& done : writers_.collect()) {
    handle(activity::PinDone{done.id, done.error});
    any = true;
  }
  feedWhatIsWatched();
  if (threaded_ && !clock_.realtime() && watches_) feedInputs();
  std::optional<Item> item;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!requests_.empty()) {
      item = std::move(requests_.front());
      requests_.pop_front();
    }
  }
  if (item) {
    handle(Requested{item->call, std::move(item->request)});
    any = true;
  }
  if (clock_.now() >= due_) {
    handle(TimerDue{});
    any = true;
  }
  return any;
}

bool Shell::takeNews() {
  if (!news_.exchange(false, std::memory_order_acq_rel)) return false;
  EngineNews news;
  news.stops_ramping = engine_.stopsRamping();
  news.stops_served = engine_.stopsServed();
  news.input_stops = engine_.inputStops();
  for (std::size_t i = 0; i < posted_.size(); ++i) {
    news.channels.push_back(engine_.channel(static_cast<int>(i)));
  }
  news_seen_ = news;
  handle(std::move(news));
  postCommands();
  return true;
}

void Shell::handle(decltype(Input::what) what) {
  activity::Outputs out;
  Input input;
  input.now = clock_.now();
  input.slipped = engine_.state().slipped;
  input.stops_asked = engine_.stopsAsked();
  input.what = std::move(what);
  if (recorder_ != nullptr) recorder_->addInput(input);
  ++turns_begun_;
  controller_.handle(input, out);
  due_ = controller_.due();
  watches_ = controller_.watchesInputs();
  carryOut(input, out);
}

void Shell::carryOut(const Input& input, activity::Outputs& out) {
  std::shared_ptr<const MachineSnapshot> shown = controller_.snapshot();
  if (recorder_ != nullptr) recorder_->addTurn(input, out, *snapshot_, *shown);
  const bool begins = motionBegins(*snapshot_, *shown);
  {
    const std::lock_guard<std::mutex> lock(answers_mutex_);
    snapshot_.swap(shown);
    for (auto& [call, reply] : out.answers) {
      const auto waiting = answers_.find(call);
      if (waiting != answers_.end()) waiting->second.reply = std::move(reply);
    }
    ++turns_;
    ++turns_ended_;
  }
  answered_.notify_all();
  if (out.stops) engine_.stopAtOnce();
  if (out.clear_stops != 0) {
    engine_.clearEmergencyStop(out.clear_stops);
    engine_.inputsChanged();
  }
  outbox_.insert(outbox_.end(), out.commands.begin(), out.commands.end());
  postCommands();
  for (const activity::PinJob& job : out.pin_jobs) {
    writers_.write(job.id, {job.output, job.level});
  }
  if (begins && on_motion_) on_motion_();
}

void Shell::postCommands() {
  while (!outbox_.empty() && engine_.post(outbox_.front())) {
    const pulse::Command& command = outbox_.front();
    for (std::size_t i = 0; i < command.follow_count; ++i) {
      posted_[static_cast<std::size_t>(command.follows[i].channel)] = command.follows[i].serial;
    }
    if (command.kind != pulse::Command::Kind::kFollow) {
      posted_[static_cast<std::size_t>(command.channel)] = command.serial;
    }
    outbox_.pop_front();
  }
}

bool Shell::ordersAreOpen() const {
  if (!outbox_.empty()) return true;
  for (std::size_t i = 0; i < posted_.size(); ++i) {
    if (i < news_seen_.channels.size() && news_seen_.channels[i].taken < posted_[i]) return true;
  }
  return false;
}

}  // namespace stepdriver::machine
