#include "pattern.h"

#include <array>
#include <new>

#include "stepdriver_core/error.h"

namespace stepdriver {

Pattern::Pattern(const char* expression) {
  const int error = regcomp(&compiled_, expression, REG_EXTENDED);
  if (error == 0) return;
  std::array<char, 128> reason{};
  regerror(error, &compiled_, reason.data(), reason.size());
  throw Error(std::string(expression) + ": " + reason.data());
}

Pattern::~Pattern() { regfree(&compiled_); }

std::vector<std::string_view> Pattern::find(const std::string& text, std::size_t from) const {
  std::vector<regmatch_t> places(compiled_.re_nsub + 1);
  places[0].rm_so = static_cast<regoff_t>(from);
  places[0].rm_eo = static_cast<regoff_t>(text.size());
  std::vector<std::string_view> parts;
  // REG_STARTEND: the text isn't terminated, and may have any character.
  const int error = regexec(&compiled_, text.c_str(), places.size(), places.data(), REG_STARTEND);
  if (error == REG_NOMATCH) return parts;
  if (error != 0) throw std::bad_alloc();
  for (const regmatch_t& place : places) {
    parts.emplace_back();
    if (place.rm_so < 0) continue;
    parts.back() = std::string_view(text).substr(
        static_cast<std::size_t>(place.rm_so), static_cast<std::size_t>(place.rm_eo - place.rm_so));
  }
  return parts;
}

}  // namespace stepdriver
