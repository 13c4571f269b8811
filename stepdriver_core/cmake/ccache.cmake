# Compiles through ccache where it is installed and no other launcher is set. The sloppiness lets it
# keep what was compiled with a precompiled header.
find_program(STEPDRIVER_CCACHE ccache)
if(STEPDRIVER_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${STEPDRIVER_CCACHE})
endif()
