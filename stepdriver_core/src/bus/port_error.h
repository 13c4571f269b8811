#pragma once

#include "stepdriver_core/error.h"

namespace stepdriver::bus {

/// A port can't be opened, or has gone: its text says why, and what helps.
class PortError : public Error {
 public:
  using Error::Error;
};

}  // namespace stepdriver::bus
