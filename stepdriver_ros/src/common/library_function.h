#pragma once

#include <dlfcn.h>

#include <cstring>

namespace stepdriver::ros_node {

/// A function of a library that a function of the program has taken the place of. The loader finds
/// the program's functions first.
///
/// @param symbol the mangled name of the function.
/// @return null if no library has it.
template <typename Function>
Function libraryFunction(const char* symbol) {
  void* const found = dlsym(RTLD_NEXT, symbol);
  Function function = nullptr;
  static_assert(sizeof(function) == sizeof(found));
  std::memcpy(&function, &found, sizeof(function));
  return function;
}

}  // namespace stepdriver::ros_node
