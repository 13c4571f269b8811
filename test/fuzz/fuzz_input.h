#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace stepdriver::fuzz {

/// Ends the program with a message if a promise is broken: libFuzzer then keeps the input.
void require(bool kept, const std::string& promise);

/// A message for a person: not empty, in one line, and of a size that a log can take.
void requireMessage(const std::string& message);

/// A folder of this process, in memory if possible. It is removed at the end.
const std::string& ownFolder();

/// Replaces the contents of a file.
void writeFile(const std::string& path, const std::uint8_t* data, std::size_t size);

}  // namespace stepdriver::fuzz
