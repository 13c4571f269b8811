#include "driver_view.h"

#include <algorithm>
#include <utility>

namespace stepdriver::console {
namespace {

template <typename Named>
const Named* find(const std::vector<Named>& all, const std::string& name) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Named& one) { return one.name == name; });
  return found == all.end() ? nullptr : &*found;
}

}  // namespace

void DriverView::update(std::vector<AxisView> axes, double now) {
  axes_ = std::move(axes);
  for (AxisView& axis : axes_) takeSwitches(axis);
  updated_ = now;
  ++updates_;
}

void DriverView::updateEndstops(const std::string& axis, bool min_active, bool max_active) {
  const auto found = std::find_if(switches_.begin(), switches_.end(),
                                  [&](const Switches& one) { return one.axis == axis; });
  Switches& switches = found == switches_.end() ? switches_.emplace_back() : *found;
  switches = {axis, min_active, max_active};
  for (AxisView& view : axes_) takeSwitches(view);
}

std::string DriverView::chipsOf(const std::string& axis) const {
  const auto found = chips_.find(axis);
  return found == chips_.end() ? "" : found->second;
}

void DriverView::forgetEvents() {
  chips_.clear();
  switches_.clear();
  for (AxisView& view : axes_) takeSwitches(view);
}

void DriverView::updateIo(std::vector<OutputView> outputs, std::vector<InputView> inputs) {
  outputs_ = std::move(outputs);
  inputs_ = std::move(inputs);
}

void DriverView::takeSwitches(AxisView& axis) const {
  axis.switches_known = false;
  for (const Switches& switches : switches_) {
    if (switches.axis != axis.name) continue;
    axis.switches_known = true;
    axis.min_active = switches.min_active;
    axis.max_active = switches.max_active;
  }
}

const AxisView* DriverView::axis(const std::string& name) const { return find(axes_, name); }

const config::AxisConfig* DriverView::config(const std::string& name) const {
  return find(configs_, name);
}

bool DriverView::configured() const {
  return configs_.size() == axes_.size() &&
         std::all_of(axes_.begin(), axes_.end(),
                     [this](const AxisView& axis) { return config(axis.name) != nullptr; });
}

std::optional<double> DriverView::age(double now) const {
  if (!updated_) return {};
  return now - *updated_;
}

bool DriverView::live(double now) const { return updated_ && now - *updated_ <= kStaleAfter; }

bool DriverView::anyFault() const {
  return std::any_of(axes_.begin(), axes_.end(),
                     [](const AxisView& axis) { return !axis.fault.empty(); });
}

double stepOf(const config::AxisConfig& config, const AxisView& axis) {
  const double steps_per_unit = config.steps_per_unit / config::configUnitsPerUnit(config.kind);
  return config.microsteps / (steps_per_unit * axis.microsteps);
}

}  // namespace stepdriver::console
