#pragma once

namespace stepdriver::python {

/// Makes the core's exceptions those of errors.py, each with its whole text.
void translateErrors();

}  // namespace stepdriver::python
