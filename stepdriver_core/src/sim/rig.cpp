#include "stepdriver_core/sim/rig.h"

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "rig_axis.h"
#include "trace_feed.h"

namespace stepdriver::sim {

class Rig::Impl {
 public:
  Impl(const std::vector<RigAxisSpec>& specs, std::shared_ptr<PinTrace> trace)
      : feed(std::move(trace)) {
    axes.reserve(specs.size());
    for (const RigAxisSpec& spec : specs) {
      const bool twin = std::any_of(axes.begin(), axes.end(), [&](const auto& axis) {
        return axis->spec().name == spec.name;
      });
      if (twin) throw std::invalid_argument("The rig has two axes named " + spec.name + ".");
      axes.push_back(std::make_unique<RigAxis>(spec));
      wire(*axes.back());
    }
  }

  ~Impl() { feed.finish(); }

  RigAxis& axisOf(const std::string& name) const {
    for (const auto& axis : axes) {
      if (axis->spec().name == name) return *axis;
    }
    throw std::out_of_range("The rig has no axis named " + name + ".");
  }

  /// @return the time, not before any that came in earlier; bounces up to it are in the trace.
  std::int64_t advance(std::int64_t time_ns) {
    latest_ns = std::max(latest_ns, time_ns);
    feed.advance(latest_ns);
    return latest_ns;
  }

  /// The level of an input by what each of its switches is.
  template <typename Active>
  bool levelOf(const std::string& line, const Active& active) const {
    const auto contacts = inputs.find(line);
    if (contacts == inputs.end()) {
      const auto other = other_inputs.find(line);
      return other != other_inputs.end() && other->second;
    }
    const auto& all = contacts->second;
    const auto first = std::find_if(all.begin(), all.end(), active);
    return first != all.end() ? (*first)->spec().active_level : !all.front()->spec().active_level;
  }

  bool settledLevelOf(const std::string& line) const {
    return levelOf(line, [](const SwitchModel* contact) { return contact->settled(); });
  }

  /// Tells the trace and whoever watches what switches did just now.
  void switchesMoved(std::int64_t time_ns) {
    feed.switchesMoved(time_ns);
    for (auto& [line, watch] : watches) {
      const bool level = settledLevelOf(line);
      if (level == watch.level) continue;
      watch.level = level;
      watch.listener(level, time_ns);
    }
  }

  struct Watch {
    gpio::EdgeListener listener;
    bool level;
  };
  struct PinOnLine {
    RigAxis* axis;
    Pin pin;
    int trace_pin;
  };
  struct WriteFault {
    std::int64_t writes_left;
    int error;
  };

  std::mutex mutex;
  std::vector<std::unique_ptr<RigAxis>> axes;
  TraceFeed feed;
  std::unordered_map<std::string, std::vector<PinOnLine>> outputs;
  std::unordered_map<std::string, std::vector<const SwitchModel*>> inputs;
  std::unordered_map<std::string, bool> other_inputs;  // levels of those that no axis has
  std::unordered_map<std::string, WriteFault> write_faults;
  std::unordered_map<std::string, Watch> watches;
  std::int64_t latest_ns = kForEver;

 private:
  void wire(RigAxis& axis) {
    for (std::size_t i = 0; i < kPinCount; ++i) {
      const Pin pin = static_cast<Pin>(i);
      const std::string& line = wireOf(axis.spec(), pin).line;
      if (line.empty()) continue;
      const TracePin trace_pin{axis.spec().name, nameOf(pin)};
      outputs[line].push_back({&axis, pin, feed.addPin(trace_pin, axis.chip().lineLevel(pin))});
    }
    wire(axis, axis.switchAt(Side::kMin), "endstop_min");
    wire(axis, axis.switchAt(Side::kMax), "endstop_max");
    wire(axis, axis.faultContact(), "fault");
  }

  void wire(const RigAxis& axis, const SwitchModel* contact, const char* variable) {
    if (contact == nullptr || contact->spec().line.empty()) return;
    inputs[contact->spec().line].push_back(contact);
    feed.addSwitch({axis.spec().name, variable}, contact);
  }
};

Rig::Rig(const std::vector<RigAxisSpec>& axes, std::shared_ptr<PinTrace> trace)
    : impl_(std::make_unique<Impl>(axes, std::move(trace))) {}

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
  impl_->axisOf(axis).setFaults(faults);
  impl_->switchesMoved(impl_->latest_ns);
}

void Rig::failWrites(const std::string& line, std::int64_t writes, int error) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->write_faults[line] = {writes, error};
}

void Rig::clearWriteFault(const std::string& line) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->write_faults.erase(line);
}

void Rig::setInput(const std::string& line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  impl_->other_inputs[line] = level;
  impl_->switchesMoved(now_ns);
}

void Rig::placeCarriage(const std::string& axis, double position, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  impl_->axisOf(axis).placeCarriage(position, now_ns);
  impl_->switchesMoved(now_ns);
}

void Rig::flushTrace() {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->feed.flush();
}

void Rig::onRequest(const std::string& line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  const auto pins = impl_->outputs.find(line);
  if (pins == impl_->outputs.end()) return;
  for (const Impl::PinOnLine& pin : pins->second) {
    impl_->feed.settle(pin.trace_pin, level, now_ns);
    pin.axis->request(pin.pin, level, now_ns);
  }
  impl_->switchesMoved(now_ns);
}

void Rig::onEdge(const std::string& line, bool level, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  const auto pins = impl_->outputs.find(line);
  if (pins == impl_->outputs.end()) return;
  for (const Impl::PinOnLine& pin : pins->second) {
    impl_->feed.edge(pin.trace_pin, level, now_ns);
    pin.axis->edge(pin.pin, level, now_ns);
  }
  impl_->switchesMoved(now_ns);
}

void Rig::onRelease(const std::string& /*line*/, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  impl_->advance(time_ns);
}

bool Rig::inputLevel(const std::string& line, std::int64_t time_ns) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  const std::int64_t now_ns = impl_->advance(time_ns);
  return impl_->levelOf(line,
                        [now_ns](const SwitchModel* contact) { return contact->active(now_ns); });
}

void Rig::watchInput(const std::string& line, gpio::EdgeListener listener) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (listener) {
    impl_->watches[line] = {std::move(listener), impl_->settledLevelOf(line)};
  } else {
    impl_->watches.erase(line);
  }
}

int Rig::writeFault(const std::string& line, std::int64_t /*time_ns*/) {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  if (impl_->write_faults.empty()) return 0;
  const auto fault = impl_->write_faults.find(line);
  if (fault == impl_->write_faults.end()) return 0;
  if (fault->second.writes_left == 0) return fault->second.error;
  --fault->second.writes_left;
  return 0;
}

}  // namespace stepdriver::sim
