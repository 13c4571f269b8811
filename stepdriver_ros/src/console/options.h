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

/// How the program is used and how it ends.
extern const char* const kUsage;

/// @throw Error where they can't be understood.
Options parseOptions(const std::vector<std::string>& arguments);

}  // namespace stepdriver::console
