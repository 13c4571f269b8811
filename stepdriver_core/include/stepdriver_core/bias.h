#pragma once

namespace stepdriver {

/// What the GPIO chip pulls an input to while nothing drives it.
enum class Bias { kAsIs, kPullUp, kPullDown, kDisabled };

}  // namespace stepdriver
