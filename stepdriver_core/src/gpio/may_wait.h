#pragma once

namespace stepdriver::gpio {

/// Whether this thread may wait until a file is written: the pulse thread may not.
inline thread_local bool this_thread_may_wait = true;

}  // namespace stepdriver::gpio
