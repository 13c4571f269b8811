#pragma once

#include <string>

#include "stepdriver_core/machine/recording.h"
#include "stepdriver_core/recorder/dumper.h"

namespace stepdriver::recorder {

/// Writes a recording to two new files, and removes the oldest ones before.
///
/// @return without an error.
/// @throw Error if a file can't be written; then neither of them exists.
Dump writeFiles(const machine::Recording& recording, const std::string& reason,
                const DumperOptions& options);

}  // namespace stepdriver::recorder
