#include "read_kinematics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "bounds.h"
#include "message_text.h"
#include "restart_speed.h"

namespace stepdriver::config {
namespace {

constexpr double kWorstCondition = 100.0;
constexpr double kMostRatio = 100.0;  // between the ways of a motor and an axis, either way

/// The named arrangements of two axes: what each motor moves by for a unit of each axis.
struct NamedMatrix {
  const char* type;
  std::array<std::array<double, 2>, 2> matrix;
};
constexpr std::array<NamedMatrix, 3> kNamed{{{"corexy", {{{1.0, 1.0}, {1.0, -1.0}}}},
                                             {"h_bot", {{{1.0, 1.0}, {1.0, -1.0}}}},
                                             {"differential", {{{1.0, 1.0}, {1.0, -1.0}}}}}};

/// The pins that either all chips of axes that share motors have, or none.
struct SwitchedPin {
  const char* key;
  Pin Pins::*pin;
};
constexpr std::array<SwitchedPin, 3> kSwitchedPins{
    {{"enable", &Pins::enable}, {"sleep", &Pins::sleep}, {"reset", &Pins::reset}}};

std::optional<double> numberOf(const ConfigValue& value) {
  if (const int* integer = value.as<int>()) return *integer;
  if (const double* number = value.as<double>(); number && std::isfinite(*number)) return *number;
  return std::nullopt;
}

/// The condition of a matrix says nothing about its scale.
std::optional<std::size_t> axisThatMovesNoMotor(const Matrix& matrix) {
  for (std::size_t axis = 0; axis < matrix.size(); ++axis) {
    const bool moves = std::any_of(matrix.begin(), matrix.end(), [axis](const auto& motor) {
      return std::abs(motor[axis]) * kMostRatio >= 1.0;
    });
    if (!moves) return axis;
  }
  return std::nullopt;
}

class KinematicsReader {
 public:
  KinematicsReader(ConfigReader& reader, bool axes_are_right, std::vector<AxisConfig>& axes)
      : reader_(reader), axes_are_right_(axes_are_right), axes_(axes) {}

  void read() {
    const std::vector<std::string> names = readNames();
    const std::optional<Matrix> matrix = readMatrix();
    reader_.rejectUnknown();
    if (names.empty() || !matrix) return;
    if (matrix->size() != names.size()) {
      return issue(reader_.has("matrix") ? "matrix" : "type",
                   fmt::format("has {} motors, but must have as many as there are axes, {}",
                               matrix->size(), names.size()));
    }
    const std::optional<Matrix> inverse = inverseOf(*matrix);
    if (!inverse) {
      return issue("matrix",
                   "is singular, but must be one with which each axis can be moved "
                   "alone; no rows may be multiples of each other");
    }
    if (const auto slow = axisThatMovesNoMotor(*matrix)) {
      return issue("matrix",
                   fmt::format("moves no motor by {0} or more for 1 of {1}, but must move one: an "
                               "axis must not make more than {2} times the way of its motors",
                               numberText(1.0 / kMostRatio), names[*slow], numberText(kMostRatio)));
    }
    if (const double condition = conditionOf(*matrix, *inverse); condition > kWorstCondition) {
      return issue("matrix",
                   fmt::format("has the condition {}, but must have one of at most {}: a microstep "
                               "of a motor would move an axis too far",
                               roughText(condition), roughText(kWorstCondition)));
    }
    if (!axes_are_right_ || !checkAxes(names)) return;
    const auto kinematics =
        std::make_shared<const Kinematics>(Kinematics{names, *matrix, *inverse});
    for (const std::string& name : names) axisOf(name)->kinematics = kinematics;
    checkRates(*kinematics);
  }

 private:
  void issue(const char* key, const std::string& message) { reader_.issue(key, message); }

  AxisConfig* axisOf(const std::string& name) const {
    const auto found = std::find_if(axes_.begin(), axes_.end(),
                                    [&](const AxisConfig& axis) { return axis.name == name; });
    return found != axes_.end() ? &*found : nullptr;
  }

  std::vector<std::string> readNames() {
    reader_.allow("axes");
    constexpr const char* kWanted = "must be a list of 2 to 4 axes";
    const auto* list = reader_.value("axes").as<ConfigValue::List>();
    if (list == nullptr) {
      issue("axes", reader_.has("axes")
                        ? fmt::format("is {}, but {}", reader_.shown("axes"), kWanted)
                        : "is missing; it must be a list of 2 to 4 axes");
      return {};
    }
    std::vector<std::string> names;
    for (const ConfigValue& value : *list) {
      const auto* name = value.as<std::string>();
      if (name == nullptr || axisOf(*name) == nullptr) {
        issue("axes", fmt::format("has {}, but must have names of axes only", value.shown()));
        return {};
      }
      if (std::find(names.begin(), names.end(), *name) != names.end()) {
        issue("axes", fmt::format("names {} twice", *name));
        return {};
      }
      names.push_back(*name);
    }
    if (names.size() < 2 || names.size() > kMostMotors) {
      issue("axes", fmt::format("has {} axes, but {}", names.size(), kWanted));
      return {};
    }
    return names;
  }

  std::optional<Matrix> readMatrix() {
    reader_.allow("matrix");
    std::vector<std::string> types;
    types.reserve(kNamed.size());
    for (const NamedMatrix& named : kNamed) types.emplace_back(named.type);
    if (!reader_.has("matrix")) {
      const auto type = reader_.findOneOf("type", types, Presence::kRequired);
      if (!type) return std::nullopt;
      const auto named = std::find_if(kNamed.begin(), kNamed.end(),
                                      [&](const auto& known) { return known.type == *type; });
      Matrix matrix;
      for (const auto& row : named->matrix) matrix.emplace_back(row.begin(), row.end());
      return matrix;
    }
    if (reader_.has("type")) {
      reader_.contradiction("type", "is given, but so is matrix; give only one of them");
    }
    reader_.allow("type");
    return readRows();
  }

  std::optional<Matrix> readRows() {
    const auto wrong = [this] {
      issue("matrix", fmt::format("is {}, but must be a list of as many lists of numbers as each "
                                  "has: [[1, 1], [1, -1]]",
                                  reader_.shown("matrix")));
      return std::nullopt;
    };
    const auto* rows = reader_.value("matrix").as<ConfigValue::List>();
    if (rows == nullptr || rows->empty()) return wrong();
    Matrix matrix;
    for (const ConfigValue& row : *rows) {
      const auto* values = row.as<ConfigValue::List>();
      if (values == nullptr || values->size() != rows->size()) return wrong();
      std::vector<double>& numbers = matrix.emplace_back();
      for (const ConfigValue& value : *values) {
        const auto number = numberOf(value);
        if (!number || std::abs(*number) > kMostRatio) return wrong();
        numbers.push_back(*number);
      }
    }
    return matrix;
  }

  /// What axes that share motors can't have.
  bool checkAxes(const std::vector<std::string>& names) {
    const std::size_t before = reader_.issues().size();
    const AxisConfig& first = *axisOf(names.front());
    for (const std::string& name : names) {
      const AxisConfig& axis = *axisOf(name);
      const auto refuse = [&](const std::string& why) {
        issue("axes", fmt::format("has {}{}", name, why));
      };
      if (axis.kind != first.kind) {
        refuse(", which must be linear or rotary like " + first.name);
      }
      if (axis.motors() > 1) {
        refuse(", which must have no motors of its own: each motor's pins stand in one axis");
      }
      if (axis.backlash > 0.0) {
        refuse(
            " with a backlash, which it must not have: a backlash belongs to a motor, and this "
            "axis shares all of them");
      }
      if (axis.idle_timeout > 0.0) {
        refuse(
            " with idle_timeout_s, which it must not have: while it rests, its motors may move "
            "another axis");
      }
      if (axis.brake) {
        refuse(" with a brake, which it must not have: no motor holds this axis alone");
      }
      if (axis.holds_position_unpowered != first.holds_position_unpowered) {
        refuse(", whose holds_position_unpowered must be that of " + first.name);
      }
      for (const SwitchedPin& pin : kSwitchedPins) {
        if ((axis.pins.*pin.pin).wired() == (first.pins.*pin.pin).wired()) continue;
        refuse(
            fmt::format(", whose pins/{} must be wired or not like that of {}: the motors are "
                        "switched together",
                        pin.key, first.name));
      }
      if (axis.enable_on_start != first.enable_on_start ||
          axis.disable_on_shutdown != first.disable_on_shutdown) {
        refuse(", whose enable_on_start and disable_on_shutdown must be those of " + first.name);
      }
      checkHoming(axis, names);
    }
    return reader_.issues().size() == before;
  }

  void checkHoming(const AxisConfig& axis, const std::vector<std::string>& names) {
    if (!axis.homing) return;
    if (axis.homing->kind == HomingKind::kIndex) {
      issue("axes", fmt::format("has {}, whose homing/kind must not be index: an index comes once "
                                "a turn of a motor, which the other axes turn too",
                                axis.name));
    }
    if (axis.homing->kind == HomingKind::kStall) {
      issue("axes", fmt::format("has {}, whose homing/kind must not be stall: a stall is of one "
                                "motor, and the others would move the axis on",
                                axis.name));
      return;
    }
    const double unit = configUnitsPerUnit(axis.kind);
    if (const double restart = restartSpeed(axis); axis.homing->seek_speed > restart * kSlack) {
      issue("axes",
            fmt::format("has {}, whose homing must seek the switch at {} {}/s at most, the speed "
                        "that the motors stop from without a ramp: a stop from a higher one would "
                        "cost the other axes their positions",
                        axis.name, upperBoundText(restart * unit),
                        axis.kind == Kind::kLinear ? "mm" : "deg"));
    }
    for (const std::string& name : names) {
      const AxisConfig& other = *axisOf(name);
      if (name >= axis.name || !other.homing || other.homing->order != axis.homing->order) continue;
      issue("axes", fmt::format("has {} and {}, whose homing/order must differ: the one moves the "
                                "motors of the other",
                                other.name, axis.name));
    }
  }

  /// The chips' rates while all axes move at their top speeds.
  void checkRates(const Kinematics& kinematics) {
    for (std::size_t i = 0; i < kinematics.axes.size(); ++i) {
      const AxisConfig& axis = *axisOf(kinematics.axes[i]);
      const double rate = highestMotorSpeed(kinematics, i, axes_) * axis.steps_per_unit;
      const double highest = 1e9 / static_cast<double>(axis.shortestStepNs());
      if (rate <= highest * kSlack) continue;
      issue("axes", fmt::format("need {} steps/s of the motor with the pins of {} when all move at "
                                "their top speeds, but the {} allows {}; lower their top speeds or "
                                "microsteps",
                                lowerBoundText(rate), axis.name, axis.driver.title,
                                upperBoundText(highest)));
    }
  }

  ConfigReader& reader_;
  const bool axes_are_right_;
  std::vector<AxisConfig>& axes_;
};

}  // namespace

void readKinematics(ConfigReader reader, bool axes_are_right, std::vector<AxisConfig>& axes) {
  if (!reader.isMap()) return;
  KinematicsReader(reader, axes_are_right, axes).read();
}

}  // namespace stepdriver::config
