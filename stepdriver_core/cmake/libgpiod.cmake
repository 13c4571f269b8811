# Chooses the libgpiod that the core uses. Sets
#   gpiod_sources  the sources that are compiled for it
#   gpiod_major    1, 2, or 0 for none
#   libgpiod_INCLUDE_DIRS, libgpiod_LIBRARIES and the target libgpiod::libgpiod, as Findlibgpiod.cmake
# A project that adds the core may include this file before it.
include_guard(DIRECTORY)
include(CheckCXXSourceCompiles)

set(STEPDRIVER_GPIOD auto CACHE STRING
  "libgpiod: auto (what is found), 1 (1.4 to 1.6), 2, or off (simulated lines only)")
set_property(CACHE STEPDRIVER_GPIOD PROPERTY STRINGS auto 1 2 off)
set(STEPDRIVER_GPIOD_ROOT "" CACHE PATH
  "Folder that a libgpiod is unpacked in, beside the system's (see scripts/libgpiod2.sh)")
if(NOT STEPDRIVER_GPIOD MATCHES "^(auto|1|2|off)$")
  message(FATAL_ERROR "STEPDRIVER_GPIOD is ${STEPDRIVER_GPIOD}; it must be auto, 1, 2 or off")
endif()

set(gpiod_major 0)
if(NOT STEPDRIVER_GPIOD STREQUAL "off")
  list(APPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})
  set(libgpiod_ROOT ${STEPDRIVER_GPIOD_ROOT})
  find_package(libgpiod QUIET)
  if(libgpiod_FOUND)
    set(gpiod_major ${libgpiod_MAJOR})
    set_target_properties(libgpiod::libgpiod PROPERTIES IMPORTED_GLOBAL TRUE)
  endif()
endif()

if(STEPDRIVER_GPIOD MATCHES "^[12]$" AND NOT STEPDRIVER_GPIOD EQUAL gpiod_major)
  if(gpiod_major)
    set(found "there is version ${gpiod_major} in ${libgpiod_INCLUDE_DIRS}")
  else()
    set(found "there is none (gpiod.h: ${libgpiod_include}, library: ${libgpiod_library})")
  endif()
  message(FATAL_ERROR "libgpiod ${STEPDRIVER_GPIOD} is asked for (STEPDRIVER_GPIOD), and ${found}. "
    "Install libgpiod-dev, or name a folder that it is unpacked in by STEPDRIVER_GPIOD_ROOT.")
endif()

get_filename_component(gpiod_folder ${CMAKE_CURRENT_LIST_DIR}/../src/gpio/libgpiod ABSOLUTE)
# It doesn't call libgpiod itself, so its test runs everywhere.
set(gpiod_sources ${gpiod_folder}/held_lines.cpp)
if(gpiod_major)
  foreach(name libgpiod_lines open_chips gpiod${gpiod_major})
    list(APPEND gpiod_sources ${gpiod_folder}/${name}.cpp)
  endforeach()
  message(STATUS "GPIO lines: libgpiod ${gpiod_major} (${libgpiod_LIBRARIES}) and simulated")
else()
  list(APPEND gpiod_sources ${gpiod_folder}/without.cpp)
  message(STATUS "GPIO lines: simulated only (STEPDRIVER_GPIOD is ${STEPDRIVER_GPIOD}; "
    "libgpiod-dev would add the real ones)")
endif()

if(gpiod_major EQUAL 1)
  set(CMAKE_REQUIRED_INCLUDES ${libgpiod_INCLUDE_DIRS})
  check_cxx_source_compiles(
    "#include <gpiod.h>
     int main() { return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP != 0 ? 0 : 1; }"
    STEPDRIVER_GPIOD_BIAS)
  unset(CMAKE_REQUIRED_INCLUDES)
endif()
