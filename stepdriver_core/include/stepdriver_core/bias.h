#pragma once

namespace stepdriver {

/// The level to which the GPIO chip pulls an input while nothing drives it.
///
/// @code{.cpp}
/// config::InputSwitch button;
/// button.line = "gpiochip0:25";
/// button.active_level = false;  // it connects the line to ground
/// button.bias = Bias::kPullUp;
/// @endcode
enum class Bias { kAsIs, kPullUp, kPullDown, kDisabled };

}  // namespace stepdriver
