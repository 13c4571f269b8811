#pragma once

#include "stepdriver_core/error.h"

namespace stepdriver::motion {

/// The numbers that a motion shall have aren't a motion; what() names the wrong one.
class Malformed : public Error {
 public:
  using Error::Error;
};

/// A motion lasts so long that its time can't be counted.
class TooLong : public Error {
 public:
  using Error::Error;
};

}  // namespace stepdriver::motion
