# Compiles through ccache if it is installed and no other launcher is set. The sloppiness lets it keep
# files that use a precompiled header. The folder of a build isn't part of the key, so that several
# builds share the core.
find_program(STEPDRIVER_CCACHE ccache)
if(STEPDRIVER_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_NOHASHDIR=1
    ${STEPDRIVER_CCACHE})
endif()
