#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "bus/bus_threads.h"
#include "gpio/line_writers.h"
#include "pulse/futex.h"
#include "pulse/pulse_engine.h"
#include "pulse/pulse_thread.h"
#include "shell_core.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "wiring.h"

namespace stepdriver::machine {

/// Puts threads around a controller's ShellCore: the controller's own, the pulse thread, the
/// watcher of the inputs. Without threads it is a pump that the waiting caller drives.
///
/// The calls of clients are safe from any thread. Mutexes protect what they write and read, and are
/// never held for longer than a copy takes; the pulse thread takes none.
class Shell : public pulse::NewsListener, private ShellCore::Host {
 public:
  struct Options {
    bool threaded = true;
    /// The timeout of one write of a line that the pulse thread doesn't time.
    std::int64_t write_timeout_ns = 0;
    pulse::RealtimeRequest realtime;
    /// Called when a motion begins, by the thread that all axes wait for: it returns at once.
    std::function<void()> on_motion;
    /// Called when a line with a name has changed, by the same thread.
    std::function<void(const IoStates&)> on_io;
    FlightRecorder* recorder = nullptr;  ///< outlives the shell; nullptr: nothing is recorded
    bus::BusThreads::Open open_port;     ///< opens the serial ports of driver chips
  };

  /// @param controller, engine, clock outlive the shell. @param wiring what the lines are.
  Shell(Controller& controller, pulse::PulseEngine& engine, pulse::Clock& clock,
        std::shared_ptr<gpio::Lines> lines, const Wiring& wiring, const Options& options);
  /// Calls stop() if that wasn't called.
  ~Shell() override;

  /// Hands over a request and waits for its answer.
  activity::Reply call(Request request);

  /// Returns true when `ready` returns true. It is called after each event, in the calling thread.
  /// @param often `ready` is also called each millisecond.
  /// @throw Error without threads, if nothing is in progress that could change its answer.
  /// @throw GpioError if the pulse thread hangs.
  void wait(const std::function<bool()>& ready, bool often = false);
  /// As wait(), but for at most this time of the steady clock. Without threads it is a time of the
  /// machine's clock, and the call also reads the inputs, like the thread that watches them.
  /// @return Whether `ready` has returned true.
  bool waitFor(const std::function<bool()>& ready, std::chrono::nanoseconds longest);

  /// Returns once a turn of the controller that is under way has ended: what it has set an outcome
  /// for can be seen in state() and snapshot() then.
  void awaitTurn();

  /// Only without threads: lets the clock run for a while.
  void advance(pulse::Nanoseconds time);

  std::shared_ptr<const MachineSnapshot> snapshot() const;
  axis::AxisState state(AxisId axis) const;
  pulse::Nanoseconds motionNow() const { return clock_.now() - engine_.state().slipped; }
  double peakRate(AxisId axis) const;

  /// What the pulse thread waits for, if its GPIO chip doesn't answer; empty: it doesn't wait.
  /// Meanwhile nothing can be done with any axis: calls and waits end with that.
  std::string whyHung() const;
  /// To be called when the engine was asked to stop: a pulse thread that hangs must be noticed.
  void wakeUp();

  /// Does what Machine::responds() does.
  bool responds(std::chrono::nanoseconds longest);

  /// The permissions of the pulse thread.
  pulse::RealtimeRights rights() const;

  /// Ends all threads; no pulse goes out from then on. Waiting calls are refused.
  void stop();

  void onNews() noexcept override;

 private:
  struct Call {
    std::optional<activity::Reply> reply;
  };

  void turnEnded(const MachineSnapshot& before, const std::shared_ptr<const MachineSnapshot>& now,
                 activity::Outputs& out) override;
  void write(const activity::PinJob& job) override;
  void access(const bus::RegisterJob& job) override;

  struct Patience {
    std::chrono::nanoseconds longest = std::chrono::nanoseconds::max();
    bool often = false;         ///< `ready` is also called each millisecond
    bool reads_inputs = false;  ///< the inputs are read each millisecond, without threads
  };
  bool await(const std::function<bool()>& ready, const Patience& patience);
  bool awaitThreads(const std::function<bool()>& ready, const Patience& patience);
  bool pump(const std::function<bool()>& ready, const Patience& patience);

  void run();
  bool beginRound();
  void watchInputs();
  bool feedInputs();
  bool turn();
  pulse::Nanoseconds alarm() const;
  void settle();
  bool isAwaited();
  bool mustWatchPulses() const;
  void watchPulses();

  Controller& controller_;
  pulse::PulseEngine& engine_;
  pulse::Clock& clock_;
  const std::shared_ptr<gpio::Lines> lines_;
  const bool has_inputs_;
  const bool threaded_;
  const std::function<void()> on_motion_;
  const std::function<void(const IoStates&)> on_io_;
  const std::int64_t most_looks_in_vain_;
  gpio::LineWriters writers_;

  ShellCore core_;
  pulse::WakeFlag wake_;  // the controller's thread waits for it
  std::atomic<bool> ending_{false};
  std::atomic<activity::CallId> calls_{0};

  std::mutex rounds_mutex_;
  std::condition_variable round_ended_;
  std::uint64_t rounds_ = 0;  // counts the rounds of the controller's thread

  // These members hold the calls of clients and their answers.
  mutable std::mutex answers_mutex_;
  std::condition_variable answered_;
  std::unordered_map<activity::CallId, Call> answers_;
  std::uint64_t changes_ = 0;      // counts the changes that a waiting client may want to look at
  std::uint64_t turns_ended_ = 0;  // counts the controller's turns
  std::string why_hung_;
  std::shared_ptr<const MachineSnapshot> snapshot_;

  std::atomic<bool> news_hold_{false};  // the clock is held for news that hasn't been handled yet

  // Only the thread that runs the controller uses these.
  std::uint64_t passes_seen_ = 0;   // the pulse thread's count when it was last seen
  std::int64_t looks_in_vain_ = 0;  // counts the looks since it has begun or ended a pass
  std::int64_t next_look_ns_ = 0;
  pulse::Nanoseconds engine_due_ = 0;

  bus::BusThreads ports_;
  std::optional<pulse::PulseThread> pulse_thread_;
  std::thread watcher_;
  std::thread thread_;
};

}  // namespace stepdriver::machine
