#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "controller.h"
#include "flight_recorder.h"
#include "input.h"
#include "pulse/pulse_engine.h"
#include "snapshot.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "told_levels.h"

namespace stepdriver::machine {

/// Passes all events to a controller in order, and its orders to an engine. It has no threads and
/// waits for nothing: a shell puts threads around it, and a test can choose which event is next.
///
/// What is said to be for any thread is safe from any; a mutex protects it for no longer than a
/// copy takes. All the rest is for one thread: the controller's.
class ShellCore {
 public:
  /// Carries out what a turn asks of others than the engine.
  class Host {
   public:
    virtual ~Host() = default;
    /// A turn of the controller has ended. Nothing that it has ordered has happened yet.
    /// @param out its answers may be moved away.
    virtual void turnEnded(const MachineSnapshot& before,
                           const std::shared_ptr<const MachineSnapshot>& now,
                           activity::Outputs& out) = 0;
    /// Writes a line that the pulse thread doesn't time. The end of the write is a PinDone.
    virtual void write(const activity::PinJob& job) = 0;
    /// Begins a job on a serial port. Its end is a bus::RegisterDone. A host without ports is never
    /// asked: no chip of its axes has one.
    virtual void access(const bus::RegisterJob& /*job*/) {}
  };

  /// @param controller, engine, clock, host outlive it. @param recorder does too; nullptr: nothing
  ///   is recorded.
  ShellCore(Controller& controller, pulse::PulseEngine& engine, pulse::Clock& clock,
            std::shared_ptr<gpio::Lines> lines, std::size_t inputs, Host& host,
            FlightRecorder* recorder);

  /// @name For any thread
  /// @{

  /// The engine has news. It waits for nobody.
  void noteNews() noexcept { news_.store(true, std::memory_order_release); }

  /// Hands over a request. If it may be refused because of the level of a switch, the inputs are
  /// read first, so that a switch that was just pressed counts.
  /// @return why not; empty if it will be answered.
  std::string post(activity::CallId call, Request request);

  /// Hands over edges of the inputs, and their present levels.
  /// @param count as Lines::waitForEdges() has returned it; not above 0: there are no edges.
  /// @param asked clock time at which that was called
  /// @return whether there is anything of which the controller must be told.
  bool watchInputs(const gpio::EdgeEvent* edges, int count, pulse::Nanoseconds asked);
  /// When watchInputs() must be called, also without edges; pulse::kNever: it needn't be.
  pulse::Nanoseconds edgesDue() const { return edges_due_.load(); }

  /// Refuses what is posted from now on.
  /// @return the calls that haven't been handled.
  std::vector<activity::CallId> close();
  /// The turns of the controller that have begun.
  std::uint64_t turnsBegun() const { return turns_begun_.load(); }
  /// @}

  bool hasNews() const { return news_.load(std::memory_order_acquire); }
  bool hasInput() const;

  /// @name Each handles an event, if there is one of its kind
  /// @return whether there was.
  /// @{
  bool takeNews();
  bool takeInput();
  /// What was seen of the inputs before the request was handed over comes before it.
  bool takeRequest();
  bool takeTime();
  /// @}
  void handle(decltype(Input::what) what);

  /// When takeTime() has something to do that somebody waits for, and when it has anything to do.
  /// @{
  pulse::Nanoseconds due() const { return due_; }
  pulse::Nanoseconds dueWithPolls() const { return std::min(due_, poll_due_); }
  /// @}
  bool watchesInputs() const { return watches_; }
  const std::shared_ptr<const MachineSnapshot>& snapshot() const { return snapshot_; }
  /// Whether the engine hasn't taken an order yet.
  bool ordersAreOpen() const;
  /// Whether the engine has no room for an order.
  bool isHeldUp() const { return !outbox_.empty(); }

 private:
  struct Item {
    activity::CallId call = 0;
    Request request;
  };
  using Seen = std::deque<decltype(Input::what)>;

  InputReading readInputs();
  bool queue(const InputReading& reading);
  void carryOut(activity::Outputs& out);
  void postCommands();

  Controller& controller_;
  pulse::PulseEngine& engine_;
  pulse::Clock& clock_;
  const std::shared_ptr<gpio::Lines> lines_;
  const int inputs_;
  Host& host_;
  FlightRecorder* const recorder_;

  std::atomic<bool> news_{true};
  std::atomic<std::uint64_t> readings_{0};  // how many have begun
  std::atomic<std::uint64_t> turns_begun_{0};
  std::atomic<pulse::Nanoseconds> edges_due_{pulse::kNever};

  mutable std::mutex mutex_;  // guards the next four
  std::deque<Item> requests_;
  Seen seen_;  // what was seen of the inputs
  ToldLevels told_levels_;
  bool closed_ = false;

  std::deque<pulse::Command> outbox_;
  std::vector<std::uint64_t> posted_;        // serial of the last command, by channel
  std::vector<std::uint64_t> posted_marks_;  // the same, by output
  EngineNews news_seen_;
  // Of the controller, which changes only when it handles an input.
  std::shared_ptr<const MachineSnapshot> snapshot_;
  pulse::Nanoseconds due_;
  pulse::Nanoseconds poll_due_;
  std::atomic<bool> watches_;
};

}  // namespace stepdriver::machine
