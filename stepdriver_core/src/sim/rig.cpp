#include "stepdriver_core/sim/rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>

#include "power_relay.h"
#include "rig_axis.h"
#include "spi_wire.h"
#include "stepdriver_core/error.h"
#include "trace_feed.h"
#include "uart_wire.h"

namespace stepdriver::sim {
namespace {

struct PinOnLine {
  enum class Of { kChip, kBrake, kMotorPower, kOutput };
  Of of;
  RigAxis* axis;  ///< the axis whose chip or brake it belongs to
  Pin pin;        ///< the pin of a chip
  int trace_pin;
};

// Places of what presses an input with a name.
constexpr double kReleased = 0.0;
constexpr double kPressed = 1.0;

struct WriteFault {
  std::int64_t writes_left;
  int error;
};

/// A line: the pins that it drives, or the contacts that drive it.
struct Line {
  std::vector<PinOnLine> pins;
  std::vector<SwitchModel*> contacts;
  std::vector<RigAxis*> axes;  // whose contacts these are
  bool other_level = false;    // of an input that no axis has
  std::optional<bool> driven;  // as an output
  std::optional<WriteFault> write_fault;
  gpio::EdgeListener listener;
  bool told_level = false;  // the last level that the listener was told

  /// The level of an input, from the state of each of its switches.
  template <typename Active>
  bool level(const Active& active) const {
    if (contacts.empty()) return other_level;
    const auto first = std::find_if(contacts.begin(), contacts.end(), active);
    return first != contacts.end() ? (*first)->spec().active_level
                                   : !contacts.front()->spec().active_level;
  }

  bool settledLevel(std::int64_t time_ns) const {
    return level([time_ns](const SwitchModel* contact) { return contact->settled(time_ns); });
  }
};

}  // namespace

class Rig::Impl {
 public:
  Impl(const std::vector<RigAxisSpec>& specs, std::shared_ptr<PinTrace> trace,
       const std::vector<RigCoupling>& couplings, const std::optional<MotorPowerSpec>& motor_power,
       const RigIo& io)
      : feed(std::move(trace)) {
    axes.reserve(specs.size());
    for (const RigAxisSpec& spec : specs) {
      const bool twin = std::any_of(axes.begin(), axes.end(), [&](const auto& axis) {
        return axis->spec().name == spec.name;
      });
      if (twin) throw Error("the rig has two axes named " + spec.name);
      axes.push_back(std::make_unique<RigAxis>(spec, slides));
      wire(*axes.back());
      if (spec.chip.step_inputs == driver::StepInputs::kPhases) {
        coil_axes.push_back(axes.back().get());
      }
    }
    for (const RigCoupling& coupling : couplings) couple(coupling);
    if (motor_power) wire(*motor_power);
    for (const RigOutput& output : io.outputs) wire(output);
    for (const RigInput& input : io.inputs) wire(input);
    connectSerial();
  }

  ~Impl() { feed.finish(summary()); }

  /// An axis whose chip has a serial interface.
  RigAxis& serialAxisOf(const std::string& name) const {
    RigAxis& axis = axisOf(name);
    if (!axis.hasSerial()) throw Error("the chip of axis " + name + " has no serial interface");
    return axis;
  }

  RigAxis& axisOf(const std::string& name) const {
    for (const auto& axis : axes) {
      if (axis->spec().name == name) return *axis;
    }
    throw Error("the rig has no axis named " + name);
  }

  /// @return the time, but not before any earlier one; bounces up to it are in the trace.
  std::int64_t advance(std::int64_t time_ns) {
    latest_ns = std::max(latest_ns, time_ns);
    feed.advance(latest_ns);
    return latest_ns;
  }

  int indexOf(const std::string& line) {
    const auto known = indexes_.emplace(line, lines.size());
    if (known.second) lines.emplace_back();
    return static_cast<int>(known.first->second);
  }
  Line& lineOf(const std::string& line) {
    if (line.empty()) throw Error("a line of the rig has an empty name, which is that of no line");
    return at(indexOf(line));
  }
  Line& at(int line) { return lines[static_cast<std::size_t>(line)]; }

  /// Reports the latest changes of switches to the trace and the listeners.
  void switchesMoved(std::int64_t time_ns) {
    feed.switchesMoved(time_ns);
    for (const int index : watched) {
      Line& line = at(index);
      const bool level = line.settledLevel(time_ns);
      if (level == line.told_level) continue;
      line.told_level = level;
      line.listener(level, time_ns);
    }
  }

  /// A line drives one of its pins with this level: by its request, or by an edge after that.
  void drive(const PinOnLine& on_line, bool is_request, bool level, std::int64_t time_ns) {
    switch (on_line.of) {
      case PinOnLine::Of::kOutput:
        break;
      case PinOnLine::Of::kMotorPower:
        relay->set(level, time_ns);
        switchPower(time_ns);
        break;
      case PinOnLine::Of::kBrake:
        on_line.axis->setBrake(level, time_ns);
        break;
      case PinOnLine::Of::kChip:
        if (is_request) {
          on_line.axis->request(on_line.pin, level, time_ns);
        } else {
          on_line.axis->edge(on_line.pin, level, time_ns);
        }
        break;
    }
  }

  /// Gives the axes the power that the relay of the motors switches.
  void switchPower(std::int64_t time_ns) {
    for (const auto& axis : axes) axis->setPower(relay->comesAt(), time_ns);
  }

  /// What each motor made of the steps.
  std::vector<std::string> summary() const {
    std::vector<std::string> texts;
    for (const auto& axis : axes) {
      if (!axis->spec().motor) continue;
      const RigAxisReport report = axis->report(latest_ns);
      texts.push_back(fmt::format("{}: largest lag {:.1f} electrical degrees, {} full steps lost",
                                  axis->spec().name, report.largest_lag, report.lost_steps));
    }
    return texts;
  }

  void failWrites(const std::string& name, const std::optional<WriteFault>& fault) {
    Line& line = lineOf(name);
    failing_lines += (fault ? 1 : 0) - (line.write_fault ? 1 : 0);
    line.write_fault = fault;
  }

  std::mutex mutex;
  Slides slides;
  std::vector<std::unique_ptr<RigAxis>> axes;
  std::vector<RigAxis*> coil_axes;  // those whose motors have coils that are switched by lines
  std::optional<PowerRelay> relay;
  std::map<std::string, SwitchModel> inputs;  // with a name
  TraceFeed feed;
  std::vector<Line> lines;
  std::vector<int> watched;           // those of them with a listener
  std::atomic<int> failing_lines{0};  // those with a write_fault: each write asks
  std::int64_t latest_ns = kForEver;
  std::map<std::string, UartWire> wires;  // by port
  std::map<std::string, SpiWire> spis;    // by device

 private:
  void connectSerial() {
    for (const auto& axis : axes) {
      if (!axis->hasSerial()) continue;
      const TmcSpec& spec = *axis->spec().tmc;
      if (axis->isOnSpi()) {
        connectSpi(spec.port, *axis);
        continue;
      }
      UartWire::Chip chip;
      chip.address = spec.address;
      chip.has_power = [this, &own = *axis] { return own.serialHasPower(latest_ns); };
      chip.read = [this, &own = *axis](int number) { return own.readRegister(number, latest_ns); };
      chip.write = [this, &own = *axis](int number, std::uint32_t value) {
        own.writeRegister(number, value, latest_ns);
      };
      wires[spec.port].add(std::move(chip));
    }
  }

  void connectSpi(const std::string& device, RigAxis& axis) {
    SpiWire::Chip chip;
    chip.has_power = [this, &axis] { return axis.serialHasPower(latest_ns); };
    chip.status = [this, &axis] { return axis.statusByte(latest_ns); };
    chip.read = [this, &axis](int number) { return axis.readRegister(number, latest_ns); };
    chip.write = [this, &axis](int number, std::uint32_t value) {
      axis.writeRegister(number, value, latest_ns);
    };
    spis.emplace(device, SpiWire(std::move(chip)));
  }

  void couple(const RigCoupling& coupling) const {
    std::vector<RigAxis*> coupled;
    for (const std::string& name : coupling.axes) coupled.push_back(&axisOf(name));
    const auto fits = [size = coupled.size()](const std::vector<std::vector<double>>& matrix) {
      return matrix.size() == size &&
             std::all_of(matrix.begin(), matrix.end(),
                         [&](const auto& row) { return row.size() == size; });
    };
    if (!fits(coupling.matrix) || !fits(coupling.inverse)) {
      throw Error(
          fmt::format("a coupling of the rig has {} axes, but must have as many rows and "
                      "columns in each of its matrices",
                      coupled.size()));
    }
    for (std::size_t i = 0; i < coupled.size(); ++i) {
      std::vector<RigAxis::Drive> drives;
      for (std::size_t k = 0; k < coupled.size(); ++k) {
        drives.push_back({coupled[k], coupling.inverse[i][k], coupling.matrix[k][i]});
      }
      coupled[i]->couple(std::move(drives));
    }
  }

  void wire(const MotorPowerSpec& motor_power) {
    relay.emplace(motor_power);
    const int index = feed.addPin({"machine", "motor_power"}, !motor_power.active_level);
    lineOf(motor_power.line).pins.push_back({PinOnLine::Of::kMotorPower, nullptr, {}, index});
    if (SwitchModel* feedback = relay->feedback()) {
      lineOf(motor_power.feedback_line).contacts.push_back(feedback);
      feed.addSwitch({"machine", "motor_power_feedback"}, feedback);
    }
    switchPower(latest_ns);
  }

  void wire(const RigOutput& output) {
    TracePin pin{"outputs", output.name};
    pin.active = output.active_level;
    const int index = feed.addPin(pin, !output.active_level);
    lineOf(output.line).pins.push_back({PinOnLine::Of::kOutput, nullptr, {}, index});
  }

  void wire(const RigInput& input) {
    SwitchSpec contact = input.contact;
    contact.position = kPressed;
    contact.hysteresis = 0.0;
    SwitchModel& own = inputs.try_emplace(input.name, contact, Side::kMax, kReleased).first->second;
    lineOf(contact.line).contacts.push_back(&own);
    feed.addSwitch({"inputs", input.name}, &own);
  }

  void wire(RigAxis& axis) {
    for (std::size_t i = 0; i < kPinCount; ++i) {
      const Pin pin = static_cast<Pin>(i);
      const std::string& line = wireOf(axis.spec(), pin).line;
      if (line.empty()) continue;
      TracePin trace_pin{axis.spec().name, nameOf(axis.spec(), pin)};
      trace_pin.active = activeLevel(axis.spec(), pin);
      trace_pin.both_edges = pin == Pin::kStep && axis.spec().chip.both_edges;
      const int index = feed.addPin(trace_pin, axis.chip().lineLevel(pin));
      lineOf(line).pins.push_back({PinOnLine::Of::kChip, &axis, pin, index});
    }
    if (const BrakeModel* brake = axis.brake()) {
      const int index = feed.addPin({axis.spec().name, "brake"}, brake->lineLevel());
      lineOf(brake->spec().line).pins.push_back({PinOnLine::Of::kBrake, &axis, {}, index});
    }
    wire(axis, axis.switchAt(Side::kMin), "endstop_min");
    wire(axis, axis.switchAt(Side::kMax), "endstop_max");
    wire(axis, axis.faultContact(), "fault");
    wire(axis, axis.inPositionContact(), "in_position");
    std::size_t number = 0;
    for (SwitchModel& flag : axis.flags()) wire(axis, &flag, fmt::format("flag{}", ++number));
    wire(axis, axis.stallContact(), "stall");
  }

  void wire(RigAxis& axis, SwitchModel* contact, const std::string& variable) {
    if (contact == nullptr || contact->spec().line.empty()) return;
    Line& line = lineOf(contact->spec().line);
    line.contacts.push_back(contact);
    line.axes.push_back(&axis);
    feed.addSwitch({axis.spec().name, variable}, contact);
  }

  std::unordered_map<std::string, std::size_t> indexes_;  // the lines' indices, by their names
};

Rig::Rig(const std::vector<RigAxisSpec>& axes, std::shared_ptr<PinTrace> trace,
         const std::vector<RigCoupling>& couplings,
         const std::optional<MotorPowerSpec>& motor_power, const RigIo& io)
    : impl_(std::make_unique<Impl>(axes, std::move(trace), couplings, motor_power, io)) {}

Rig::~Rig() = default;

RigAxisReport Rig::report(const std::string& axis) const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->axisOf(axis).report(impl_->latest_ns);
}

std::vector<std::string> Rig::axes() const {
  std::vector<std::string> names;
  for (const auto& axis : impl_->axes) names.push_back(axis->spec().name);
  return names;
}

void Rig::setFaults(const std::string& axis, const RigFaults& faults) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->axisOf(axis).setFaults(faults, impl_->latest_ns);
  impl_->switchesMoved(impl_->latest_ns);
}

void Rig::stickMotorPower(std::optional<bool> on, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (!impl_->relay) throw Error("the rig has no relay of the motor power");
  const std::int64_t now_ns = impl_->advance(time_ns);
  impl_->relay->stick(on, now_ns);
  impl_->switchPower(now_ns);
  impl_->switchesMoved(now_ns);
}

void Rig::failWrites(const std::string& line, std::int64_t writes, int error) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->failWrites(line, WriteFault{writes, error});
}

void Rig::clearWriteFault(const std::string& line) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->failWrites(line, std::nullopt);
}

void Rig::pressInput(const std::string& name, bool pressed, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const auto input = impl_->inputs.find(name);
  if (input == impl_->inputs.end()) throw Error("the rig has no input named " + name);
  const std::int64_t now_ns = impl_->advance(time_ns);
  input->second.follow(pressed ? kPressed : kReleased, now_ns);
  impl_->switchesMoved(now_ns);
}

void Rig::stickInput(const std::string& line, std::optional<bool> active, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const auto named = impl_->inputs.find(line);
  const std::int64_t now_ns = impl_->advance(time_ns);
  const std::string& wire = named != impl_->inputs.end() ? named->second.spec().line : line;
  for (SwitchModel* contact : impl_->lineOf(wire).contacts) contact->stick(active);
  impl_->switchesMoved(now_ns);
}

std::optional<bool> Rig::outputLevel(const std::string& line) const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->lineOf(line).driven;
}

void Rig::setInput(const std::string& line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  impl_->lineOf(line).other_level = level;
  impl_->switchesMoved(now_ns);
}

void Rig::placeCarriage(const std::string& axis, double position, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  impl_->axisOf(axis).placeCarriage(position, now_ns);
  impl_->switchesMoved(now_ns);
}

void Rig::brownOut(const std::string& axis) { powerChip(axis, true); }

void Rig::powerChip(const std::string& axis, bool has_power) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->serialAxisOf(axis).powerChip(has_power, impl_->latest_ns);
  impl_->switchesMoved(impl_->latest_ns);
}

void Rig::setTrouble(const std::string& axis, const TmcTrouble& trouble) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->serialAxisOf(axis).setTrouble(trouble, impl_->latest_ns);
  impl_->switchesMoved(impl_->latest_ns);
}

void Rig::setWireFaults(const std::string& port, const WireFaults& faults) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (const auto spi = impl_->spis.find(port); spi != impl_->spis.end()) {
    return spi->second.setFaults(faults);
  }
  const auto wire = impl_->wires.find(port);
  if (wire == impl_->wires.end()) throw Error("the rig has no chip on the serial port " + port);
  wire->second.setFaults(faults);
}

std::uint32_t Rig::registerOf(const std::string& axis, int number) const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->serialAxisOf(axis).writtenRegister(number);
}

bool Rig::hasSerial(const std::string& port) const {
  return impl_->wires.count(port) + impl_->spis.count(port) != 0;
}

std::vector<std::uint8_t> Rig::onBytes(const std::string& port, const std::uint8_t* bytes,
                                       std::size_t count, bool pause, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->advance(time_ns);
  std::vector<std::uint8_t> heard;
  if (const auto spi = impl_->spis.find(port); spi != impl_->spis.end()) {
    heard = spi->second.transfer(bytes, count);
  } else {
    UartWire& wire = impl_->wires.at(port);
    if (pause) wire.pause();
    heard = wire.send(bytes, count);
  }
  impl_->switchesMoved(impl_->latest_ns);
  return heard;
}

void Rig::clockStalled() {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  for (const auto& axis : impl_->axes) axis->clockStalled();
}

void Rig::flushTrace() {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->feed.flush();
}

int Rig::lineIndex(const std::string& line) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->indexOf(line);
}

void Rig::onRequest(int line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  Line& driven = impl_->at(line);
  driven.driven = level;
  const std::vector<PinOnLine>& pins = driven.pins;
  if (pins.empty()) return;
  for (const PinOnLine& pin : pins) {
    impl_->feed.settle(pin.trace_pin, level, now_ns);
    impl_->drive(pin, true, level, now_ns);
  }
  impl_->switchesMoved(now_ns);
}

void Rig::onEdge(int line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  Line& driven = impl_->at(line);
  driven.driven = level;
  const std::vector<PinOnLine>& pins = driven.pins;
  if (pins.empty()) return;
  for (const PinOnLine& pin : pins) {
    impl_->feed.edge(pin.trace_pin, level, now_ns);
    impl_->drive(pin, false, level, now_ns);
  }
  impl_->switchesMoved(now_ns);
}

void Rig::onWriteEnd(std::int64_t time_ns) {
  if (impl_->coil_axes.empty()) return;
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  for (RigAxis* axis : impl_->coil_axes) axis->coilsWritten(now_ns);
  impl_->switchesMoved(now_ns);
}

void Rig::onRelease(int line, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->advance(time_ns);
  for (const PinOnLine& pin : impl_->at(line).pins) {
    if (pin.of == PinOnLine::Of::kChip) pin.axis->released(pin.pin);
  }
}

bool Rig::inputLevel(int line, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  const Line& input = impl_->at(line);
  for (RigAxis* axis : input.axes) axis->turnMotors(now_ns);
  for (SwitchModel* contact : input.contacts) contact->noteRead(now_ns);
  return input.level([now_ns](const SwitchModel* contact) { return contact->active(now_ns); });
}

void Rig::watchInput(int line, gpio::EdgeListener listener) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  std::vector<int>& watched = impl_->watched;
  watched.erase(std::remove(watched.begin(), watched.end(), line), watched.end());
  Line& input = impl_->at(line);
  input.listener = std::move(listener);
  if (!input.listener) return;
  input.told_level = input.settledLevel(impl_->latest_ns);
  watched.push_back(line);
}

int Rig::writeFault(int line, std::int64_t /*time_ns*/) {
  if (impl_->failing_lines.load(std::memory_order_relaxed) == 0) return 0;
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  std::optional<WriteFault>& fault = impl_->at(line).write_fault;
  if (!fault) return 0;
  if (fault->writes_left == 0) return fault->error;
  --fault->writes_left;
  return 0;
}

}  // namespace stepdriver::sim
