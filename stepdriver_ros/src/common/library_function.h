#pragma once

#include <dlfcn.h>
#include <elf.h>
#include <link.h>

#include <cstddef>
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

/// What lies at an address that the loader has found.
template <typename Content>
const Content* contentAt(ElfW(Addr) address) {
  const Content* content = nullptr;
  static_assert(sizeof(void*) == sizeof(address));
  std::memcpy(&content, &address, sizeof(address));
  return content;
}

/// Whether the library that has this function also calls it by its name, so that a function of the
/// program takes its place there too. With the linker's option -Bsymbolic-functions, which Ubuntu's
/// packages are built with, it calls its own one directly.
///
/// @param symbol the mangled name of the function.
inline bool libraryCallsByName(const char* symbol) {
  void* const function = dlsym(RTLD_NEXT, symbol);
  Dl_info info{};
  link_map* library = nullptr;
  if (function == nullptr ||
      dladdr1(function, &info, reinterpret_cast<void**>(&library), RTLD_DL_LINKMAP) == 0) {
    return false;
  }
  // The entries of its table of calls, each with the number of a symbol.
  const char* entries = nullptr;
  std::size_t bytes = 0;
  bool with_addend = true;
  const ElfW(Sym)* symbols = nullptr;
  const char* names = nullptr;
  for (const ElfW(Dyn)* each = library->l_ld; each->d_tag != DT_NULL; ++each) {
    if (each->d_tag == DT_JMPREL) entries = contentAt<char>(each->d_un.d_ptr);
    if (each->d_tag == DT_PLTRELSZ) bytes = each->d_un.d_val;
    if (each->d_tag == DT_PLTREL) with_addend = each->d_un.d_val == DT_RELA;
    if (each->d_tag == DT_SYMTAB) symbols = contentAt<ElfW(Sym)>(each->d_un.d_ptr);
    if (each->d_tag == DT_STRTAB) names = contentAt<char>(each->d_un.d_ptr);
  }
  if (entries == nullptr || symbols == nullptr || names == nullptr) return false;
  const std::size_t size = with_addend ? sizeof(ElfW(Rela)) : sizeof(ElfW(Rel));
  for (std::size_t at = 0; at + size <= bytes; at += size) {
    ElfW(Rel) entry;  // what comes first in both kinds
    std::memcpy(&entry, entries + at, sizeof entry);
    const std::size_t number =
        sizeof(void*) == 8 ? ELF64_R_SYM(entry.r_info) : ELF32_R_SYM(entry.r_info);
    if (std::strcmp(names + symbols[number].st_name, symbol) == 0) return true;
  }
  return false;
}

}  // namespace stepdriver::ros_node
