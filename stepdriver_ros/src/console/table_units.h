#pragma once

#include <string>

namespace stepdriver::console {

/// A position or a distance as the table and the messages show it: `12.3456 mm`.
///
/// @param value [mm|deg]
/// @param unit `mm` or `deg`.
std::string positionText(double value, const std::string& unit);

/// How the table shows one axis.
struct TableUnits {
  double per_unit = 1.0;  ///< mm per m, or degrees per rad
  std::string unit;       ///< `mm` or `deg`

  /// @param position [m|rad]
  std::string place(double position) const { return positionText(position * per_unit, unit); }
};

/// "x moves to 20.0000 mm in 1.2 s"; it names the nearest microstep if the target is none.
///
/// @param target, rest [m|rad]
/// @param duration [s]
std::string moveText(const std::string& axis, const TableUnits& units, double target, double rest,
                     double duration);

/// A text of the driver, which has m and rad, with its numbers in mm and degrees. In such a text,
/// each number has its own unit: `0.25 m`, `0.1 m/s`, `1.5 rad`.
std::string inTableUnits(const std::string& text);

}  // namespace stepdriver::console
