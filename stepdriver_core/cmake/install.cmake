# Installs the core so that other projects find it by find_package(stepdriver_core) or by pkg-config. The paths follow CMAKE_INSTALL_LIBDIR and CMAKE_INSTALL_INCLUDEDIR, which a project that
# adds this folder may set.
include(CMakePackageConfigHelpers)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/stepdriver_core)
set(made_folder ${CMAKE_CURRENT_BINARY_DIR}/installed)

install(TARGETS stepdriver_core EXPORT stepdriver_core
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT stepdriver_core NAMESPACE stepdriver_core:: FILE stepdriver_coreTargets.cmake
  DESTINATION ${package_folder})
set(left_out "")
if(TARGET stepdriver_core_yaml)
  # Separate from the core's targets: projects that link only the core don't need yaml-cpp.
  install(TARGETS stepdriver_core_yaml EXPORT stepdriver_core_yaml
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT stepdriver_core_yaml NAMESPACE stepdriver_core::
    FILE stepdriver_core_yamlTargets.cmake DESTINATION ${package_folder})
else()
  set(left_out PATTERN yaml.h EXCLUDE)
endif()
install(DIRECTORY include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h" ${left_out})

configure_package_config_file(cmake/stepdriver_coreConfig.cmake.in
  ${made_folder}/stepdriver_coreConfig.cmake INSTALL_DESTINATION ${package_folder}
  NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${made_folder}/stepdriver_coreConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${made_folder}/stepdriver_coreConfig.cmake
  ${made_folder}/stepdriver_coreConfigVersion.cmake cmake/Findlibgpiod.cmake
  DESTINATION ${package_folder})

# A static library contains no list of the libraries that it needs, so plain `pkg-config --libs` names
# them too. Paths are relative to the file itself, so that the installed folder can be moved.
file(RELATIVE_PATH pc_to_prefix /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
set(pc_requires "fmt, zlib")
if(gpiod_major EQUAL 1)
  set(pc_requires "fmt, zlib, libgpiod < 2")
elseif(gpiod_major EQUAL 2)
  set(pc_requires "fmt, zlib, libgpiod >= 2")
endif()
get_target_property(library_type stepdriver_core TYPE)
if(library_type STREQUAL "STATIC_LIBRARY")
  set(pc_yaml_needs "Requires: stepdriver_core, yaml-cpp")
  set(pc_needs "Requires: ${pc_requires}\nLibs: -L\${libdir} -lstepdriver_core -pthread")
else()
  set(pc_yaml_needs "Requires: stepdriver_core\nRequires.private: yaml-cpp")
  set(pc_needs "Requires.private: ${pc_requires}\nLibs: -L\${libdir} -lstepdriver_core\nLibs.private: -pthread")
endif()
configure_file(cmake/stepdriver_core.pc.in ${made_folder}/stepdriver_core.pc @ONLY)
install(FILES ${made_folder}/stepdriver_core.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
if(TARGET stepdriver_core_yaml)
  configure_file(cmake/stepdriver_core_yaml.pc.in ${made_folder}/stepdriver_core_yaml.pc @ONLY)
  install(FILES ${made_folder}/stepdriver_core_yaml.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endif()
