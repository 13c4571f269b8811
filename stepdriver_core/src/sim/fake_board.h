#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "board_wire.h"

namespace stepdriver::sim {

/// What is different between boards.
struct BoardKind {
  std::string mcu;
  double clock_hz = 0.0;
  std::uint16_t move_count = 0;  ///< entries for steps and timed outputs of the whole board
  unsigned pins = 0;             ///< gpio0 and so on
};
/// @name Boards as their firmware describes them
/// @{
BoardKind rp2040();
BoardKind stm32f446();
BoardKind atmega2560();
/// @}

/// The pins of a fake board, by their numbers.
class BoardPins {
 public:
  virtual ~BoardPins() = default;
  /// The pin is an output with this level from now on. @return false: it can't be.
  virtual bool drive(unsigned pin, bool level) = 0;
  /// The pin is an input from now on. @return false: it can't be.
  virtual bool listen(unsigned pin) = 0;
  virtual void write(unsigned pin, bool level) = 0;
  virtual bool read(unsigned pin) = 0;
};

/// A board with Klipper's firmware, written from the description of its protocol and from what is
/// known of its behaviour: it plays queue_step onto pins by a clock of its own.
///
///     board.receive(bytes, count);  // from the host
///     board.play(now);              // at due(), or later: edges are made at this call
///     const auto bytes = board.take();
class FakeBoard {
 public:
  using Bytes = BoardWire::Bytes;
  using Nanoseconds = std::int64_t;

  /// @param pins outlive this. @param drift by which its clock is faster than nominal.
  FakeBoard(BoardPins& pins, BoardKind kind, double drift_ppm = 0.0,
            std::uint32_t clock_at_start = 0);
  ~FakeBoard();

  /// At the time of the last play().
  void receive(const std::uint8_t* bytes, std::size_t count);
  Bytes take() { return wire_.take(); }
  bool hasBytes() const { return wire_.hasBytes(); }
  void play(Nanoseconds now);
  /// When play() has something to do.
  Nanoseconds due() const;

  /// @name What goes wrong
  /// @{
  /// It forgets all, as after a loss of power: pins float.
  void powerCycle();
  void shutDown(const std::string& reason);
  /// Another host has configured it.
  void configuredBy(std::uint32_t crc);
  /// Another host has talked to it.
  void expectSequence(std::uint8_t sequence) { wire_.expect(sequence); }
  /// The firmware lacks a command, by its whole format. Before the first byte.
  void lack(const std::string& format);
  /// @}

  bool isShutdown() const { return shutdown_.has_value(); }
  const std::string& reason() const { return reason_; }
  /// How often something came later than planned: a step was pushed back.
  std::uint64_t pushedBack() const { return pushed_back_; }
  /// Steps that were dropped in silence.
  std::uint64_t droppedMoves() const { return dropped_moves_; }
  /// The most entries that were in use.
  std::size_t mostEntries() const { return most_entries_; }
  std::int64_t tickOf(Nanoseconds time) const;

 private:
  struct Stepper;
  struct Trsync;
  struct Endstop;
  struct DigitalOut;
  struct Format;

  void describe();
  void handle(BoardReader& reader);
  bool configures(const std::string& name, const std::vector<std::uint32_t>& arguments);
  bool steps(const std::string& name, const std::vector<std::uint32_t>& arguments);
  bool watches(const std::string& name, const std::vector<std::uint32_t>& arguments);
  void identify(std::uint32_t offset, std::uint32_t count);
  void answer(const std::string& name, const std::vector<std::uint32_t>& arguments);
  template <typename Object>
  Object* find(std::map<std::uint32_t, Object>& objects, std::uint32_t oid);

  void queueStep(Stepper& stepper, const std::vector<std::uint32_t>& arguments);
  void loadNext(Stepper& stepper);
  void playEdge(Stepper& stepper);
  void stop(Stepper& stepper);
  void trigger(Trsync& trsync, std::uint32_t reason);
  void report(const Trsync& trsync, std::uint32_t oid);
  void sample(Endstop& endstop);
  void countEntries();
  std::int64_t nextEvent() const;
  void playAt(std::int64_t tick);
  Nanoseconds timeOf(std::int64_t tick) const;
  /// The 64-bit tick nearest to now of which only the lower half is known.
  std::int64_t widened(std::uint32_t ticks) const;

  BoardPins& pins_;
  const BoardKind kind_;
  const double frequency_;
  const std::uint32_t clock_at_start_;
  std::vector<Format> commands_;
  std::map<std::string, std::uint32_t> answers_;
  std::map<std::string, std::uint32_t> texts_;
  std::vector<std::string> lacking_;
  Bytes dictionary_;
  BoardWire wire_;
  std::int64_t now_ = 0;  // ticks
  std::optional<std::uint32_t> config_;
  std::uint32_t oids_ = 0;
  std::optional<std::uint32_t> shutdown_;
  std::string reason_;
  std::uint64_t starts_ = 0;  // after the first one
  std::uint64_t shutdowns_ = 0;
  std::map<std::uint32_t, Stepper> steppers_;
  std::map<std::uint32_t, Trsync> trsyncs_;
  std::map<std::uint32_t, Endstop> endstops_;
  std::map<std::uint32_t, DigitalOut> outputs_;
  std::uint64_t pushed_back_ = 0;
  std::uint64_t dropped_moves_ = 0;
  std::size_t most_entries_ = 0;
};

}  // namespace stepdriver::sim
