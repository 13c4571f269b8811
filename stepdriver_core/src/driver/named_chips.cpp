#include "named_chips.h"

namespace stepdriver::driver {
namespace {

constexpr std::int64_t kMicrosecond = 1'000;
constexpr std::int64_t kMillisecond = 1'000'000;

constexpr bool kLow = false;
constexpr bool kHigh = true;

// No datasheet says how long RESET has to be held, or how long the chip takes after it. 1 ms is
// far above any logic delay; the wake-up time covers the charge pump, which RESET may have stopped.
constexpr std::int64_t kResetLow = 1 * kMillisecond;

/// The shortest pulse and the shortest gap are equal.
void setStepTimes(Timing& timing, std::int64_t each_ns) {
  timing.step_high_ns = each_ns;
  timing.step_low_ns = each_ns;
}

/// The setup and the hold are equal.
void setDirTimes(Timing& timing, std::int64_t each_ns) {
  timing.dir_setup_ns = each_ns;
  timing.dir_hold_ns = each_ns;
}

/// The setup and the hold are equal.
void setModeTimes(Timing& timing, std::int64_t each_ns) {
  timing.mode_setup_ns = each_ns;
  timing.mode_hold_ns = each_ns;
}

/// Allegro 4988-DS.
DriverChip a4988() {
  DriverChip chip;
  chip.name = "a4988";
  chip.title = "A4988";
  setStepTimes(chip.timing, 1 * kMicrosecond);
  setDirTimes(chip.timing, 200);
  setModeTimes(chip.timing, 200);
  chip.timing.enable_ns = 0;  // none given
  chip.timing.wake_ns = 1 * kMillisecond;
  chip.timing.reset_low_ns = kResetLow;
  chip.timing.reset_wait_ns = chip.timing.wake_ns;
  chip.modes = {{1, {kLow, kLow, kLow}},
                {2, {kHigh, kLow, kLow}},
                {4, {kLow, kHigh, kLow}},
                {8, {kHigh, kHigh, kLow}},
                {16, {kHigh, kHigh, kHigh}}};
  chip.mode_pins = 3;
  chip.microsteps = {1, 2, 4, 8, 16};
  chip.enable_on = kLow;
  chip.sleep_asleep = kLow;
  chip.reset_held = kLow;
  chip.disabled = TranslatorState::kCounts;
  return chip;
}

/// TI SLVSA73F.
DriverChip drv8825() {
  DriverChip chip;
  chip.name = "drv8825";
  chip.title = "DRV8825";
  chip.timing.step_high_ns = 1'900;
  // 1.9 us alone, but at least 4 us from step to step: 250 kHz.
  chip.timing.step_low_ns = 2'100;
  setDirTimes(chip.timing, 650);
  setModeTimes(chip.timing, 650);
  chip.timing.enable_ns = 650;
  chip.timing.wake_ns = 1'700 * kMicrosecond;
  chip.timing.reset_low_ns = kResetLow;
  chip.timing.reset_wait_ns = chip.timing.wake_ns;
  // 1/16 is LLH here and HHH on the A4988: a code must never be carried over from the other chip.
  // Three codes select 1/32.
  chip.modes = {{1, {kLow, kLow, kLow}},    {2, {kHigh, kLow, kLow}},   {4, {kLow, kHigh, kLow}},
                {8, {kHigh, kHigh, kLow}},  {16, {kLow, kLow, kHigh}},  {32, {kHigh, kLow, kHigh}},
                {32, {kLow, kHigh, kHigh}}, {32, {kHigh, kHigh, kHigh}}};
  chip.mode_pins = 3;
  chip.mode_pins_from_0 = true;
  chip.microsteps = {1, 2, 4, 8, 16, 32};
  chip.enable_on = kLow;
  chip.sleep_asleep = kLow;
  chip.reset_held = kLow;
  chip.fault_active = kLow;  // nFAULT, an open drain
  chip.fault_name = "nFAULT";
  chip.fault_end = FaultEnd::kReset;  // "Overcurrent Protection (OCP)"
  return chip;
}

/// DFRobot's TB6600 manual V1.2; if it gives no figure, the needs of slower clones.
DriverChip tb6600() {
  DriverChip chip;
  chip.name = "tb6600";
  chip.title = "TB6600";
  // The IC itself needs 2.2 us. The optocouplers of modules need more, and those of clones most.
  setStepTimes(chip.timing, 5 * kMicrosecond);
  setDirTimes(chip.timing, 5 * kMicrosecond);
  chip.timing.enable_ns = 200 * kMillisecond;
  // The IC has the modes 1 to 16; the DIP switches of the common modules go to 32.
  chip.microsteps = {1, 2, 4, 8, 16, 32};
  chip.opto_inputs = true;
  chip.enable_on = kLow;  // ENA lights an LED, and the lit LED frees the motor
  return chip;
}

/// The step/dir timing of Trinamic's drivers: TMC22xx datasheets, "STEP/DIR Interface", "Timing".
void setTrinamicTiming(Timing& timing) {
  // max(tFILTSD, tCLK + 20 ns), typically 100 ns. 200 ns allows for a clock of 5.6 MHz, half of the
  // internal one's 12 MHz and less.
  setStepTimes(timing, 200);
  setDirTimes(timing, 20);  // tDSU and tDSH
  // Not stated: far above a few periods of the clock.
  setModeTimes(timing, 1 * kMicrosecond);
  timing.enable_ns = 1 * kMillisecond;
}

/// What the TMC2208 and the TMC2209 share if they are configured by pins.
DriverChip tmc220x() {
  DriverChip chip;
  setTrinamicTiming(chip.timing);
  chip.mode_pins = 2;
  chip.enable_on = kLow;  // ENN
  // TMC2226 datasheet, 3.6.1: steps restore the microstep counter before the driver is enabled.
  chip.disabled = TranslatorState::kCounts;
  chip.fault_active = kHigh;  // DIAG (Analog Devices AN-045)
  chip.fault_name = "DIAG";
  chip.fault_end = FaultEnd::kEnable;    // its pin table: ENN high resets an error
  chip.timing.reset_low_ns = kResetLow;  // not stated
  return chip;
}

DriverChip tmc2208() {
  DriverChip chip = tmc220x();
  chip.name = "tmc2208";
  chip.title = "TMC2208";
  // The TMC2209's table marks its differences; the TMC2208's codes are those of OnStepX.
  chip.modes = {{8, {kLow, kLow}}, {2, {kHigh, kLow}}, {4, {kLow, kHigh}}, {16, {kHigh, kHigh}}};
  chip.microsteps = {2, 4, 8, 16};
  return chip;
}

DriverChip tmc2209() {
  DriverChip chip = tmc220x();
  chip.name = "tmc2209";
  chip.title = "TMC2209";
  // "MS1/MS2: Configuration of microstep resolution for STEP input", different from the TMC2208's.
  chip.modes = {{8, {kLow, kLow}}, {32, {kHigh, kLow}}, {64, {kLow, kHigh}}, {16, {kHigh, kHigh}}};
  chip.microsteps = {8, 16, 32, 64};
  return chip;
}

/// A TMC2209 in a larger case, with the same pins and registers (TMC2226 datasheet).
DriverChip tmc2226() {
  DriverChip chip = tmc2209();
  chip.name = "tmc2226";
  chip.title = "TMC2226";
  return chip;
}

/// The chip in standalone mode, configured by CFG1 and CFG2 as a TMC2100 is (SilentStepStick FAQ).
DriverChip tmc2130() {
  DriverChip chip;
  chip.name = "tmc2130";
  chip.title = "TMC2130";
  setTrinamicTiming(chip.timing);
  // The TMC2100's codes are those of OnStepX. An open pin selects interpolated modes of the same
  // numbers of microsteps.
  chip.modes = {{1, {kLow, kLow}}, {2, {kHigh, kLow}}, {4, {kLow, kHigh}}, {16, {kHigh, kHigh}}};
  chip.mode_pins = 2;
  chip.microsteps = {1, 2, 4, 16};
  chip.enable_on = kLow;                     // EN
  chip.disabled = TranslatorState::kCounts;  // not stated: as in the TMC22xx
  return chip;
}

/// Without `tmc` its pins CFG0 and CFG1 are strapped to one of these modes, before the power comes
/// (TMC5160 datasheet, standalone operation).
DriverChip tmc5160() {
  DriverChip chip;
  chip.name = "tmc5160";
  chip.title = "TMC5160";
  setTrinamicTiming(chip.timing);
  chip.microsteps = {8, 16, 32, 64};
  chip.enable_on = kLow;                     // DRV_ENN
  chip.disabled = TranslatorState::kCounts;  // not stated: as in the TMC22xx
  return chip;
}

/// Its own datasheet wasn't at hand: the figures are those of its siblings DRV8424 and DRV8884.
DriverChip drv8434() {
  DriverChip chip;
  chip.name = "drv8434";
  chip.title = "DRV8434";
  // 970 ns (TI E2E about the DRV8424's datasheet, 6.6), but at most 500 kHz (DRV8884, SLVSDA5E,
  // "Indexer Timing Requirements").
  setStepTimes(chip.timing, 1 * kMicrosecond);
  // 200 ns for DIR and the microstep pins (SLVSDA5E).
  setDirTimes(chip.timing, 200);
  setModeTimes(chip.timing, 200);
  chip.timing.enable_ns = 5 * kMicrosecond;
  chip.timing.wake_ns = 2 * kMillisecond;  // not found: longer than the DRV8825's
  // M0 and M1 also have codes with an open pin and with 330 kOhm to ground, which a line can't set.
  chip.modes = {{1, {kLow, kLow}}, {2, {kHigh, kLow}}, {4, {kLow, kHigh}}, {8, {kHigh, kHigh}}};
  chip.mode_pins = 2;
  chip.mode_pins_from_0 = true;
  chip.microsteps = {1, 2, 4, 8, 16, 32, 64, 128, 256};
  chip.enable_on = kHigh;  // SLVSDA5E, "Pin Configuration and Functions"
  chip.sleep_asleep = kLow;
  chip.fault_active = kLow;    // nFAULT, an open drain
  chip.fault_name = "nFAULT";  // not stated what ends it: by power, as the data is by default
  return chip;
}

/// ON Semiconductor LV8729V, on a module.
DriverChip lv8729() {
  DriverChip chip;
  chip.name = "lv8729";
  chip.title = "LV8729";
  // RepRapFirmware's table of timings gives 0.5 us, descriptions of the module 1 us.
  setStepTimes(chip.timing, 1 * kMicrosecond);
  setDirTimes(chip.timing, 500);
  setModeTimes(chip.timing, 500);
  chip.timing.enable_ns = 1 * kMillisecond;  // not stated
  chip.timing.wake_ns = 2 * kMillisecond;    // not stated
  chip.modes = {{1, {kLow, kLow, kLow}},    {2, {kHigh, kLow, kLow}},    {4, {kLow, kHigh, kLow}},
                {8, {kHigh, kHigh, kLow}},  {16, {kLow, kLow, kHigh}},   {32, {kHigh, kLow, kHigh}},
                {64, {kLow, kHigh, kHigh}}, {128, {kHigh, kHigh, kHigh}}};
  chip.mode_pins = 3;
  chip.microsteps = {1, 2, 4, 8, 16, 32, 64, 128};
  chip.enable_on = kLow;
  chip.sleep_asleep = kLow;
  // Sources disagree about the level of RESET: only a configuration that knows its board states it.
  return chip;
}

/// A module with Toshiba's TB6560AHQ (data sheet of 2014-10-01).
DriverChip tb6560() {
  DriverChip chip;
  chip.name = "tb6560";
  chip.title = "TB6560";
  // Section 8: the minimum depends on the capacitor of the oscillator. Marlin takes 30 us, and 15
  // kHz at most.
  chip.timing.step_high_ns = 30 * kMicrosecond;
  chip.timing.step_low_ns = 37 * kMicrosecond;
  // Not in the data sheet: Marlin's guess.
  setDirTimes(chip.timing, 15 * kMicrosecond);
  chip.timing.enable_ns = 200 * kMillisecond;  // not stated: as a TB6600
  chip.microsteps = {1, 2, 8, 16};
  chip.opto_inputs = true;
  chip.enable_on = kLow;  // as on a TB6600; boards differ
  return chip;
}

/// Leadshine, DM542 Fully Digital Stepper Drive Manual V1.0.
DriverChip dm542() {
  DriverChip chip;
  chip.name = "dm542";
  chip.title = "DM542";
  setStepTimes(chip.timing, 2'500);  // section 10, t3 and t4
  // The setup is t2 of section 10. The hold isn't stated: as the setup.
  setDirTimes(chip.timing, 5 * kMicrosecond);
  chip.timing.enable_ns = 200 * kMillisecond;  // t1 is 5 us there, and 200 ms in later manuals
  chip.microsteps = {2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128};  // section 7
  chip.opto_inputs = true;
  chip.enable_on = kLow;  // section 3: the lit LED of ENA disables it
  return chip;
}

/// No manual was found: it is the DM542's larger sibling, with the same inputs and switches.
DriverChip dm556() {
  DriverChip chip = dm542();
  chip.name = "dm556";
  chip.title = "DM556";
  return chip;
}

/// StepperOnline CL57T, a closed-loop driver. Of its manual (V4.1) only excerpts were found.
DriverChip cl57t() {
  DriverChip chip;
  chip.name = "cl57t";
  chip.title = "CL57T";
  setStepTimes(chip.timing, 2'500);
  setDirTimes(chip.timing, 5 * kMicrosecond);  // the hold isn't stated: as the setup
  // 200 ms, and 500 ms in the manual of its sibling CS-D808.
  chip.timing.enable_ns = 500 * kMillisecond;
  // Switches set the pulses of a revolution: any number of microsteps.
  chip.opto_inputs = true;
  chip.enable_on = kLow;  // the lit LED of ENA disables it
  // The alarm output is a contact to ground with a pull-up: it opens at an alarm, so that a broken
  // wire is an alarm too.
  chip.fault_active = kHigh;
  chip.in_position_active = kLow;  // PEND closes in position: a broken wire means that it isn't
  chip.in_position_name = "PEND";
  chip.fault_name = "ALM";  // not stated what ends it: by power, as the data is by default
  return chip;
}

/// TI SLRS027, with a motor of four phases such as the 28BYJ-48 (Kiatronics' data sheet).
DriverChip uln2003() {
  DriverChip chip;
  chip.name = "uln2003";
  chip.title = "ULN2003";
  // tPLH and tPHL, at most.
  setStepTimes(chip.timing, 1 * kMicrosecond);
  // Not stated: the rotor swings to the pattern. The motor starts at 600 half steps/s at least, so
  // it makes one in 1.7 ms, and this is six of them.
  chip.timing.enable_ns = 10 * kMillisecond;
  chip.microsteps = {1, 2};
  chip.step_inputs = StepInputs::kPhases;
  chip.both_edges = true;
  return chip;
}

}  // namespace

const std::vector<DriverChip>& namedChips() {
  static const std::vector<DriverChip> chips{a4988(),   drv8825(), tb6600(),  tmc2208(), tmc2209(),
                                             tmc2226(), tmc2130(), tmc5160(), drv8434(), lv8729(),
                                             tb6560(),  dm542(),   dm556(),   cl57t(),   uln2003()};
  return chips;
}

}  // namespace stepdriver::driver
