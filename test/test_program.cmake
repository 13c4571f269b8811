# The options of all test programs, of the core and of the node: all warnings, and little optimization, for
# a fast build. The code under test is compiled as it is installed, or with all of the sanitizers: for that of
# the tests, undefined behaviour would take half of the compiler's time.
function(stepdriver_test_options target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_STANDARD 17 CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow
    $<$<CONFIG:RelWithDebInfo>:-O1> $<$<CONFIG:RelWithDebInfo>:-g1>
    $<$<CONFIG:Sanitized>:-fno-sanitize=undefined>)
endfunction()
