#pragma once

namespace stepdriver {

/// The level to which the GPIO chip pulls an input while nothing drives it.
enum class Bias { kAsIs, kPullUp, kPullDown, kDisabled };

}  // namespace stepdriver
