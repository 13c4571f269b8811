#include "shell_core.h"

#include <utility>

namespace stepdriver::machine {
namespace {

constexpr std::size_t kMostRequests = 256;

}  // namespace

ShellCore::ShellCore(Controller& controller, pulse::PulseEngine& engine, pulse::Clock& clock,
                     std::shared_ptr<gpio::Lines> lines, std::size_t inputs, Host& host,
                     FlightRecorder* recorder)
    : controller_(controller),
      engine_(engine),
      clock_(clock),
      lines_(std::move(lines)),
      inputs_(static_cast<int>(inputs)),
      host_(host),
      recorder_(recorder),
      told_levels_(inputs),
      posted_(engine.channels()),
      posted_marks_(engine.outputs()),
      snapshot_(controller.snapshot()),
      due_(controller.due()),
      poll_due_(controller.pollDue()),
      watches_(controller.watchesInputs()) {
  watchInputs(nullptr, 0, clock.now());
}

// ---- any thread ----

std::string ShellCore::post(activity::CallId call, Request request) {
  std::optional<InputReading> reading;
  if (readsInputs(request)) reading = readInputs();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (closed_) return "the machine was shut down";
  if (requests_.size() >= kMostRequests) return "too many requests are already waiting";
  if (reading) queue(*reading);
  requests_.push_back({call, std::move(request)});
  return {};
}

bool ShellCore::watchInputs(const gpio::EdgeEvent* edges, int count, pulse::Nanoseconds asked) {
  for (int i = 0; i < count; ++i)
    engine_.noteEdge(edges[i].input, edges[i].level, edges[i].time_ns);
  const InputReading reading = readInputs();
  const std::lock_guard<std::mutex> lock(mutex_);
  for (int i = 0; i < count; ++i) seen_.emplace_back(InputEdge{edges[i]});
  const bool changed = queue(reading) || count > 0;
  // If nothing was left to report, everything that was reported before the call is known.
  if (count > 0 || asked < edges_due_) return changed;
  seen_.emplace_back(EdgesTaken{asked});
  return true;
}

std::vector<activity::CallId> ShellCore::close() {
  const std::lock_guard<std::mutex> lock(mutex_);
  closed_ = true;
  std::vector<activity::CallId> open;
  for (const Item& item : std::exchange(requests_, {})) open.push_back(item.call);
  return open;
}

InputReading ShellCore::readInputs() {
  InputReading reading{++readings_, {}};
  reading.levels.reserve(static_cast<std::size_t>(inputs_));
  for (int input = 0; input < inputs_; ++input) reading.levels.push_back(lines_->read(input));
  return reading;
}

// Queues what the controller must be told of it. Call it with the mutex.
bool ShellCore::queue(const InputReading& reading) {
  const std::vector<InputRead> changed = told_levels_.differences(reading);
  seen_.insert(seen_.end(), changed.begin(), changed.end());
  return !changed.empty();
}

// ---- the thread of the controller ----

bool ShellCore::hasInput() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !seen_.empty();
}

bool ShellCore::takeNews() {
  if (!news_.exchange(false, std::memory_order_acq_rel)) return false;
  EngineNews news;
  news.stops_ramping = engine_.stopsRamping();
  news.stops_served = engine_.stopsServed();
  news.input_stops = engine_.inputStops();
  for (std::size_t i = 0; i < posted_.size(); ++i) {
    news.channels.push_back(engine_.channel(static_cast<int>(i)));
  }
  for (std::size_t i = 0; i < posted_marks_.size(); ++i) news.outputs.push_back(engine_.output(i));
  news_seen_ = news;
  handle(std::move(news));
  postCommands();
  return true;
}

bool ShellCore::takeInput() {
  std::optional<decltype(Input::what)> seen;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (seen_.empty()) return false;
    seen = std::move(seen_.front());
    seen_.pop_front();
  }
  handle(*std::move(seen));
  return true;
}

bool ShellCore::takeRequest() {
  Seen seen;
  Item item;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (requests_.empty()) return false;
    seen.swap(seen_);
    item = std::move(requests_.front());
    requests_.pop_front();
  }
  for (auto& what : seen) handle(std::move(what));
  handle(Requested{item.call, std::move(item.request)});
  return true;
}

bool ShellCore::takeTime() {
  if (clock_.now() < dueWithPolls()) return false;
  handle(TimerDue{});
  return true;
}

void ShellCore::handle(decltype(Input::what) what) {
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
  poll_due_ = controller_.pollDue();
  watches_ = controller_.watchesInputs();
  edges_due_ = controller_.edgesDue();
  const std::shared_ptr<const MachineSnapshot> before =
      std::exchange(snapshot_, controller_.snapshot());
  if (recorder_ != nullptr) recorder_->addTurn(input, out, *before, *snapshot_);
  host_.turnEnded(*before, snapshot_, out);
  carryOut(out);
}

void ShellCore::carryOut(activity::Outputs& out) {
  if (out.stops) engine_.stopAtOnce();
  if (out.clear_stops != 0) {
    engine_.clearEmergencyStop(out.clear_stops);
    engine_.inputsChanged();
  }
  outbox_.insert(outbox_.end(), out.commands.begin(), out.commands.end());
  postCommands();
  for (const activity::PinJob& job : out.pin_jobs) host_.write(job);
  for (const bus::RegisterJob& job : out.register_jobs) host_.access(job);
}

void ShellCore::postCommands() {
  while (!outbox_.empty() && engine_.post(outbox_.front())) {
    const pulse::Command& command = outbox_.front();
    for (std::size_t i = 0; i < command.follow_count; ++i) {
      posted_[static_cast<std::size_t>(command.follows[i].channel)] = command.follows[i].serial;
    }
    for (std::size_t i = 0; i < command.marks_count; ++i) {
      posted_marks_[command.marks[i].output] = command.marks[i].serial;
    }
    if (command.kind == pulse::Command::Kind::kEndMarks ||
        command.kind == pulse::Command::Kind::kCompare) {
      posted_marks_[command.output] = command.serial;
    } else if (command.kind != pulse::Command::Kind::kFollow) {
      posted_[static_cast<std::size_t>(command.channel)] = command.serial;
    }
    outbox_.pop_front();
  }
}

bool ShellCore::ordersAreOpen() const {
  if (!outbox_.empty()) return true;
  for (std::size_t i = 0; i < posted_.size(); ++i) {
    if (i < news_seen_.channels.size() && news_seen_.channels[i].taken < posted_[i]) return true;
  }
  for (std::size_t i = 0; i < posted_marks_.size(); ++i) {
    if (i < news_seen_.outputs.size() && news_seen_.outputs[i].taken < posted_marks_[i])
      return true;
  }
  return false;
}

}  // namespace stepdriver::machine
