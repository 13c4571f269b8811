# Which libgpiod the lines go through. Sets
#   gpiod_sources  the sources that are compiled for it
#   gpiod_major    1, 2, or 0 for none
#   gpiod_include, gpiod_library
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
# What was found is looked for again each time: it must not outlive a change of the two above.
unset(gpiod_include CACHE)
unset(gpiod_library CACHE)
if(NOT STEPDRIVER_GPIOD STREQUAL "off")
  if(STEPDRIVER_GPIOD_ROOT)
    set(places PATHS ${STEPDRIVER_GPIOD_ROOT}/usr ${STEPDRIVER_GPIOD_ROOT} NO_DEFAULT_PATH)
  else()
    find_package(PkgConfig QUIET)
    if(PKG_CONFIG_FOUND)
      pkg_check_modules(pkg_gpiod QUIET libgpiod)
    endif()
    set(places HINTS ${pkg_gpiod_INCLUDE_DIRS} ${pkg_gpiod_LIBRARY_DIRS})
  endif()
  find_path(gpiod_include gpiod.h ${places} PATH_SUFFIXES include)
  find_library(gpiod_library gpiod ${places} PATH_SUFFIXES lib lib/${CMAKE_LIBRARY_ARCHITECTURE})
  mark_as_advanced(gpiod_include gpiod_library)
  if(gpiod_include AND gpiod_library)
    file(STRINGS ${gpiod_include}/gpiod.h gpiod_version_call
      REGEX "gpiod_(api_version|version_string)\\(" LIMIT_COUNT 1)
    if(gpiod_version_call MATCHES "gpiod_api_version")
      set(gpiod_major 2)
    elseif(gpiod_version_call)
      set(gpiod_major 1)
    endif()
  endif()
endif()

if(STEPDRIVER_GPIOD MATCHES "^[12]$" AND NOT STEPDRIVER_GPIOD EQUAL gpiod_major)
  if(gpiod_major)
    set(found "there is version ${gpiod_major} in ${gpiod_include}")
  else()
    set(found "there is none (gpiod.h: ${gpiod_include}, library: ${gpiod_library})")
  endif()
  message(FATAL_ERROR "libgpiod ${STEPDRIVER_GPIOD} is asked for (STEPDRIVER_GPIOD), and ${found}. "
    "Install libgpiod-dev, or name a folder that it is unpacked in by STEPDRIVER_GPIOD_ROOT.")
endif()

set(gpiod_folder ${CMAKE_CURRENT_SOURCE_DIR}/src/gpio/libgpiod)
# It calls no libgpiod itself, and so its test runs everywhere.
set(gpiod_sources ${gpiod_folder}/held_lines.cpp)
if(gpiod_major)
  foreach(name libgpiod_lines open_chips gpiod${gpiod_major})
    list(APPEND gpiod_sources ${gpiod_folder}/${name}.cpp)
  endforeach()
  message(STATUS "GPIO lines: libgpiod ${gpiod_major} (${gpiod_library}) and simulated")
else()
  list(APPEND gpiod_sources ${gpiod_folder}/without.cpp)
  message(STATUS "GPIO lines: simulated only (STEPDRIVER_GPIOD is ${STEPDRIVER_GPIOD}; "
    "libgpiod-dev would add the real ones)")
endif()

if(gpiod_major EQUAL 1)
  set(CMAKE_REQUIRED_INCLUDES ${gpiod_include})
  check_cxx_source_compiles(
    "#include <gpiod.h>
     int main() { return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP != 0 ? 0 : 1; }"
    STEPDRIVER_GPIOD_BIAS)
  unset(CMAKE_REQUIRED_INCLUDES)
endif()
