#pragma once

#include <string>
#include <vector>

#include "session.h"
#include "wizard/wizard.h"

namespace stepdriver::console {

struct Options {
  bool help = false;
  std::string driver = "stepdriver";
  JogSpeeds speeds;
  bool wizard = false;
  WizardOptions wizard_options;
};

/// The usage and the exit codes of the program.
extern const char* const kUsage;

/// @throw Error if they can't be understood.
Options parseOptions(const std::vector<std::string>& arguments);

}  // namespace stepdriver::console
