#pragma once

#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace stepdriver::config {

/// An unchecked configuration, as the parameter server or a YAML file contains it.
///
/// @code{.cpp}
/// using config::ConfigValue;
/// const ConfigValue gpio = ConfigValue::Map{{"backend", "simulated"}};
/// std::cout << gpio.shown() << "\n";                                      // "a map of 1"
/// std::cout << *gpio.as<ConfigValue::Map>()->at("backend").as<std::string>() << "\n";
/// @endcode
class ConfigValue {
 public:
  /// Both may contain values of any type, including each other.
  using List = std::vector<ConfigValue>;
  using Map = std::map<std::string, ConfigValue>;

  ConfigValue() = default;
  ConfigValue(bool value) : value_(value) {}                      // NOLINT: a value is a value
  ConfigValue(int value) : value_(value) {}                       // NOLINT
  ConfigValue(double value) : value_(value) {}                    // NOLINT
  ConfigValue(const char* value) : value_(std::string(value)) {}  // NOLINT
  ConfigValue(std::string value) : value_(std::move(value)) {}    // NOLINT
  ConfigValue(List value) : value_(std::move(value)) {}           // NOLINT
  ConfigValue(Map value) : value_(std::move(value)) {}            // NOLINT

  /// @return nullptr if the value is of another type. An int is not a double here.
  template <typename T>
  const T* as() const {
    return std::get_if<T>(&value_);
  }
  template <typename T>
  T* as() {
    return std::get_if<T>(&value_);
  }

  /// @param keys of a map, in the order in which they were written.
  void setKeyOrder(std::vector<std::string> keys) { key_order_ = std::move(keys); }
  /// The keys of a map: those whose order is known in that order, and then the others, sorted.
  std::vector<std::string> orderedKeys() const;

  /// Whether this is a key without a value, such as `key:` in YAML.
  bool isNothing() const { return std::holds_alternative<std::monostate>(value_); }

  /// The value as messages show it: `"abc"`, `1.5`, `true`, `a map of 3`, `nothing`.
  std::string shown() const;

 private:
  std::variant<std::monostate, bool, int, double, std::string, List, Map> value_;
  std::vector<std::string> key_order_;  // may have keys that the map doesn't have
};

}  // namespace stepdriver::config
