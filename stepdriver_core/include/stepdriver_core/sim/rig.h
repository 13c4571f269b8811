#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/sim/pin_trace.h"

/// The simulated rig: for each axis a driver chip that reads its pins as the datasheet says, a
/// motor, a carriage and two switches, behind the lines of a gpio::SimulatedBackend.
namespace stepdriver::sim {

/// How a line reaches the chip. An empty name: the pin isn't wired. An unwired ENABLE energizes the
/// motor, an unwired SLEEP or RESET does nothing, an unwired DIR is low (high where inverted), and
/// unwired microstep pins are strapped as RigAxisSpec::microsteps says.
struct Wire {
  std::string line;
  bool inverted = false;  ///< the chip sees the other level, as with common-anode wiring
};

/// An endstop switch that the carriage presses.
///
/// After each change its line has the new level at once, then bounces on-off pairs of edges, each
/// bounce_ns after the one before, and so ends at the new level.
struct SwitchSpec {
  std::string line;
  bool active_level = false;   ///< level of the line while the switch is pressed
  double position = 0.0;       ///< [mm|deg] pressed from here on outwards
  double hysteresis = 0.0;     ///< [mm|deg] released again this far inside of position
  int bounces = 0;             ///< extra on-off pairs after each change
  std::int64_t bounce_ns = 0;  ///< time from one bounce edge to the next
};

/// An axis of the rig, as it is built and wired.
struct RigAxisSpec {
  std::string name;
  driver::Model model = driver::Model::kA4988;
  driver::Timing timing{};  ///< what counts as a violation
  Wire step, dir, enable, ms1, ms2, ms3, sleep, reset;
  int microsteps = 1;             ///< the DIP switches, or how unwired microstep pins are strapped
  double full_step_travel = 0.0;  ///< [mm|deg] that the carriage moves for a full step; above 0
  double start = 0.0;             ///< [mm|deg] where the carriage stands when the rig is made
  std::optional<SwitchSpec> min_switch, max_switch;
  std::string fault_line;  ///< the chip's nFAULT, with a pull-up; empty: not wired
};

/// Everything that the chip must never see. One edge may be several of them. A time that is exactly
/// the limit is none.
enum class Violation {
  kShortStepHigh,
  kShortStepLow,
  kDirSetup,
  kDirHold,
  kModeSetup,
  kModeHold,
  kUndefinedMode,      ///< an undefined code on the microstep pins, even in passing, or at a step
  kStepWhileDisabled,  ///< whether the chip counts it or not
  kStepAfterEnable,    ///< before the enable time is over
  kStepWhileAsleep,
  kStepAfterWake,   ///< before the wake-up time is over
  kStepInReset,     ///< while RESET is held, or before the time after it is over
  kStepIntoSwitch,  ///< a step towards a switch whose line reads active
};

/// In words, as in reports: `short step high`.
const char* nameOf(Violation violation);

/// What an axis of the rig has seen so far.
struct RigAxisReport {
  std::int64_t pulses_forward = 0;  ///< active STEP edges with DIR forward, taken or not
  std::int64_t pulses_backward = 0;
  std::int64_t translator = 0;  ///< microsteps of the finest mode, counted from Home at start;
                                ///< RESET and SLEEP bring it to the nearest Home
  double carriage = 0.0;        ///< [mm|deg]
  int microsteps = 1;           ///< the mode that the last STEP edge was taken in
  bool energized = false;       ///< current flows: enabled, awake and not in RESET
  bool min_pressed = false;     ///< as its line read at the last time that the rig was told
  bool max_pressed = false;
  std::map<Violation, std::int64_t> violations;  ///< only kinds that occurred

  /// Of all kinds together.
  std::int64_t totalViolations() const;
};

/// Knobs that break things.
struct RigFaults {
  std::optional<bool> min_stuck;  ///< the switch reads active (true) or inactive whatever happens
  std::optional<bool> max_stuck;
  std::int64_t lose_every = 0;  ///< every n-th step of the motor, counted from setFaults() on,
                                ///< slips: the carriage stays behind for good; 0: none
  /// Over-current after this many steps of the motor, counted from setFaults() on: outputs off and
  /// nFAULT low until RESET.
  std::optional<std::int64_t> chip_fault_after;
};

/// The model of an axis. STEP's active edge moves the translator to the next place that the mode
/// has, where the chip counts: not asleep, not in RESET, and enabled unless the chip counts anyway.
/// While current flows the rotor follows the translator, and the carriage the rotor. When current
/// starts to flow, the rotor snaps to the place nearest to it that has the translator's phase: a
/// multiple of an electrical cycle away from the translator's own count. DIR high at the chip is
/// forward, where the carriage's position grows.
///
/// Lines. Before its first request a line stands as pull resistors towards the safe side leave it:
/// disabled, asleep, in RESET, all else inactive or low. The first request makes no edge: the line
/// is taken to have had its level for ever, but a chip that it enables, wakes or lets out of RESET
/// is so from that time on. A released line keeps its level; a later request is an edge where its
/// level is another one. Lines that no axis knows are ignored, unknown inputs read low until
/// setInput(). A line may go to several pins and axes; switches that share a line read active where
/// any of them does. Who watches a switch is told when the carriage or a fault changes its line,
/// not of the bounces after that.
///
/// All calls are safe from any thread. Times that fall back are taken as the latest one so far.
class Rig : public gpio::Board {
 public:
  /// @param trace where every edge goes, in the order of time, also those of bouncing switches;
  ///   levels are those of the lines. May be null.
  /// @throw std::invalid_argument where an axis is named twice, doesn't travel, or has microsteps
  ///   that its chip hasn't.
  explicit Rig(const std::vector<RigAxisSpec>& axes, std::shared_ptr<PinTrace> trace = nullptr);
  ~Rig() override;

  /// @throw std::out_of_range where there is no such axis; so do all that take an axis.
  RigAxisReport report(const std::string& axis) const;
  /// Their names, in the order in which they were given.
  std::vector<std::string> axes() const;

  /// Takes effect at the latest time that the rig was told.
  void setFaults(const std::string& axis, const RigFaults& faults);

  /// The write that comes after `writes` more successful ones on this line fails with `error`
  /// (an errno), and so do all after it until clearWriteFault(). A write that fails for the sake of
  /// another line may count.
  void failWrites(const std::string& line, std::int64_t writes, int error);
  /// Writes of this line succeed again.
  void clearWriteFault(const std::string& line);

  /// Gives an input that no axis has a level, as a switch beside the axes does: the emergency stop.
  void setInput(const std::string& line, bool level, std::int64_t time_ns);

  /// Puts the carriage somewhere else, as a hand would: no step is counted, and the rotor turns
  /// with it. Against current it snaps to the nearest place with the translator's phase, up to two
  /// full steps away.
  void placeCarriage(const std::string& axis, double position, std::int64_t time_ns);

  /// Makes the trace readable up to its last edge while the rig lives.
  ///
  /// @throw Error where the trace can't be written.
  void flushTrace();

  int lineIndex(const std::string& line) override;
  void onRequest(int line, bool level, std::int64_t time_ns) override;
  void onEdge(int line, bool level, std::int64_t time_ns) override;
  void onRelease(int line, std::int64_t time_ns) override;
  bool inputLevel(int line, std::int64_t time_ns) override;
  int writeFault(int line, std::int64_t time_ns) override;
  void watchInput(int line, gpio::EdgeListener listener) override;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::sim
