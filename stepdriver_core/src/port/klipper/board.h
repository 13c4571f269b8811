#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "port/klipper/board_clock.h"
#include "port/klipper/link.h"
#include "port/klipper/messages.h"
#include "port/klipper/transport.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::klipper {

/// A board: its firmware, its configuration, its clock, and the line to it.
///
///     Board board("mcu", open, clock, {});
///     board.identify();                             // what is it?
///     const auto oid = board.addStepper("gpio2", "gpio3", false, 24);
///     board.configure();                            // it has these objects from now on
///     board.send(Command::kStepperGetPosition, {oid});
///     board.serve(now);                             // whenever due() is over, and after send()
///
/// The functions until configure() wait for answers, and throw. All others don't wait, don't throw,
/// and are for the thread that serves the board; failure() and reason() are for any thread.
///
/// A board that has failed belongs to nobody once that thread has called release(). Another thread
/// may bring it back then:
///
///     if (board.isReleased()) {
///       board.reopen();  // the same firmware, configured anew if it must be
///       board.resume();  // the thread that serves it has it again
///     }
class Board {
 public:
  /// Opens the line to the board. It throws BoardError if that isn't there.
  using Open = std::function<std::unique_ptr<Link>()>;

  struct Options {
    /// A board that another program has configured is reset instead of refused. One that has shut
    /// down is reset in any case.
    bool resets_foreign = false;
  };

  /// Is told what the board says, within serve().
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void heard(const Heard& heard, Nanoseconds now) = 0;
    /// The board can't be used any more, see reason().
    virtual void lost(Nanoseconds now) = 0;
  };

  /// @param name of the configuration. @param open is used again whenever the board was reset: its
  ///   port may go then, and come back. @param clock outlives this.
  Board(std::string name, Open open, pulse::Clock& clock, Options options);

  /// @name At the start
  /// @{
  /// @throw BoardError if nothing answers, or if the firmware isn't one that can be used.
  void identify();
  /// @throw BoardError if the board has no such pin; it lists some that it has.
  std::uint32_t pin(const std::string& name) const;
  /// [ticks] At least this time.
  std::uint32_t ticksOf(Nanoseconds time) const;

  /// @name Objects of the board; each returns its number
  /// @{
  std::uint32_t addStepper(std::uint32_t step_pin, std::uint32_t dir_pin, bool inverted,
                           std::uint32_t pulse_ticks);
  std::uint32_t addTrsync();
  /// @param pull_up whether the board pulls it up.
  std::uint32_t addEndstop(std::uint32_t pin, bool pull_up);
  /// @param level from the configuration on, and whenever the firmware shuts down.
  /// @param watched if the host doesn't confirm the other level within kWatchdog, the firmware
  ///   shuts down.
  std::uint32_t addOutput(std::uint32_t pin, bool level, bool watched);
  /// @}

  static constexpr Nanoseconds kWatchdog = 2'000'000'000;

  /// Gives the board its objects, unless it has exactly these from before, and reads its clock.
  /// @throw BoardError
  void configure();
  /// Asks and waits for the answer of this object. @throw BoardError
  Heard ask(Command command, std::initializer_list<std::uint32_t> arguments, Answer answer);
  /// @}

  /// @name After a failure
  /// @{
  /// If it has failed, the thread that serves it uses it no more until failure() is 0.
  void release();
  bool isReleased() const { return owner_.load(std::memory_order_acquire) == Owner::kNobody; }
  /// Does what identify() and configure() do, by another line to the board. Its outputs have the
  /// levels of addOutput() then. ask() works as at the start. @pre isReleased()
  /// @throw BoardError if it isn't there, or has another firmware than before.
  void reopen();
  /// Ends the failure. @pre reopen() has succeeded.
  void resume();
  /// It is still failed, for this reason.
  void stayFailed(const std::string& reason);
  /// How often resume() was called.
  std::uint64_t resumed() const { return resumed_.load(std::memory_order_relaxed); }
  /// @}

  /// @param listener nullptr: nobody, as at the start. Failures are thrown then.
  void listen(Listener* listener) { listener_ = listener; }
  void send(Command command, std::initializer_list<std::uint32_t> arguments);
  /// Sets an output from addOutput().
  void setOutput(std::uint32_t oid, bool level);
  /// Reads, tells the listener, and writes what can be written.
  void serve(Nanoseconds now);
  Nanoseconds due(Nanoseconds now) const;
  /// Sends what is left, for a short time. For the end, when nobody serves it any more.
  void flush();

  BoardClock& boardClock() { return *board_clock_; }
  std::uint16_t moveCount() const { return move_count_; }
  const std::string& name() const { return name_; }
  const std::string& version() const { return dictionary_.version(); }
  const std::string& mcu() const { return mcu_; }
  Transport::Figures figures() const { return transport_.figures(); }

  /// errno of what is wrong with it; 0: nothing is.
  int failure() const { return failure_.load(std::memory_order_acquire); }
  /// In words, if there is one: "its firmware has shut down: Timer too close".
  std::string reason() const;

 private:
  struct Output {
    std::uint32_t oid = 0;
    bool level = false;
    bool at_shutdown = false;
    bool watched = false;
  };

  void openLine();
  void connect();
  std::vector<std::uint8_t> readIdentity();
  void comeBack();
  void checkIdentity();
  void throwIfFailed() const;
  std::optional<Heard> exchange(Answer answer, std::optional<std::uint32_t> oid);
  void reset();
  void awaitDelivery();
  void add(Command command, std::initializer_list<std::uint32_t> arguments);
  void readClock();
  void receive();
  void transmit(Nanoseconds now);
  void hear(const Heard& heard, Nanoseconds now);
  void keepTime(Nanoseconds now);
  void keepOutputs(Nanoseconds now);
  /// Who may use the line to the board, and all that is known of it.
  enum class Owner {
    kServer,  ///< the thread that serves it
    kFailed,  ///< still that thread, which doesn't know yet that the board has failed
    kNobody   ///< whoever brings it back
  };

  bool hasFailed() const;
  void fail(int error, const std::string& reason, Nanoseconds now);
  /// The line to the board has failed with this errno.
  void failLine(int error, Nanoseconds now);

  const std::string name_;
  const Open open_;
  std::unique_ptr<Link> link_;
  pulse::Clock& clock_;
  const Options options_;
  Listener* listener_ = nullptr;
  Transport transport_;
  Dictionary dictionary_;
  std::string mcu_;
  std::optional<Messages> messages_;
  std::unique_ptr<BoardClock> board_clock_;
  std::vector<Message> objects_;
  std::uint32_t oids_ = 0;
  std::vector<Output> outputs_;
  std::uint16_t move_count_ = 0;
  std::optional<Nanoseconds> clock_asked_;
  Nanoseconds clock_due_ = 0;
  int clocks_ = 0;
  Nanoseconds outputs_due_ = 0;
  /// @name At the start
  /// @{
  std::optional<Heard> awaited_;
  std::vector<std::uint8_t> identity_;
  std::string start_failure_;
  /// @}
  std::atomic<int> failure_{0};
  std::atomic<Owner> owner_{Owner::kServer};
  std::atomic<std::uint64_t> resumed_{0};
  mutable std::mutex reason_mutex_;  // the thread that serves the board takes it when it fails
  std::string reason_;
};

}  // namespace stepdriver::klipper
