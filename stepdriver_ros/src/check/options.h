#pragma once

#include <optional>
#include <string>
#include <vector>

#include "configuration.h"

namespace stepdriver::check {

struct Options {
  bool help = false;
  std::string config;
  BackendChoice backend = BackendChoice::kAsInTheFile;
  bool wiring = false;  ///< test the lines to the drivers that are on a UART
  bool move = false;
  std::string axis;                ///< the only axis to move; empty: all, one after the other
  std::optional<double> distance;  ///< [mm|deg]
};

/// The usage and the exit codes of the program.
extern const char* const kUsage;

/// @throw Error if they can't be understood.
Options parseOptions(const std::vector<std::string>& arguments);

}  // namespace stepdriver::check
