#pragma once

#include <gtest/gtest.h>

#include <string>

namespace stepdriver::node_test {

/// The test fails if the words are not in the text.
inline void expectSays(const std::string& text, const std::string& words) {
  EXPECT_NE(text.find(words), std::string::npos) << "\"" << text << "\" doesn't say: " << words;
}

}  // namespace stepdriver::node_test
