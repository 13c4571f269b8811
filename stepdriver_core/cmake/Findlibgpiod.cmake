# Finds libgpiod, for the build of the core and for projects that link the core. Sets
#   libgpiod_FOUND
#   libgpiod_MAJOR         1 or 2
#   libgpiod_INCLUDE_DIRS, libgpiod_LIBRARIES
# and makes the target libgpiod::libgpiod. If libgpiod_ROOT is set, it is looked for only there.

# A result in the cache must not outlive a change of libgpiod_ROOT.
unset(libgpiod_include CACHE)
unset(libgpiod_library CACHE)
if(libgpiod_ROOT)
  set(libgpiod_places PATHS ${libgpiod_ROOT}/usr ${libgpiod_ROOT} NO_DEFAULT_PATH)
else()
  find_package(PkgConfig QUIET)
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(pkg_libgpiod QUIET libgpiod)
  endif()
  set(libgpiod_places HINTS ${pkg_libgpiod_INCLUDE_DIRS} ${pkg_libgpiod_LIBRARY_DIRS})
endif()
find_path(libgpiod_include gpiod.h ${libgpiod_places} PATH_SUFFIXES include)
find_library(libgpiod_library gpiod ${libgpiod_places}
  PATH_SUFFIXES lib lib/${CMAKE_LIBRARY_ARCHITECTURE})
mark_as_advanced(libgpiod_include libgpiod_library)

# gpiod.h doesn't give its version in any other way.
unset(libgpiod_MAJOR)
if(libgpiod_include AND libgpiod_library)
  file(STRINGS ${libgpiod_include}/gpiod.h libgpiod_version_call
    REGEX "gpiod_(api_version|version_string)\\(" LIMIT_COUNT 1)
  if(libgpiod_version_call MATCHES "gpiod_api_version")
    set(libgpiod_MAJOR 2)
  elseif(libgpiod_version_call)
    set(libgpiod_MAJOR 1)
  endif()
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(libgpiod
  REQUIRED_VARS libgpiod_library libgpiod_include libgpiod_MAJOR)
if(libgpiod_FOUND)
  set(libgpiod_INCLUDE_DIRS ${libgpiod_include})
  set(libgpiod_LIBRARIES ${libgpiod_library})
  if(NOT TARGET libgpiod::libgpiod)
    add_library(libgpiod::libgpiod UNKNOWN IMPORTED)
    set_target_properties(libgpiod::libgpiod PROPERTIES
      IMPORTED_LOCATION ${libgpiod_library} INTERFACE_INCLUDE_DIRECTORIES ${libgpiod_include})
  endif()
endif()
