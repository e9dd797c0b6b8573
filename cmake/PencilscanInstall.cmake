# Installs the program, the libraries with their headers, and the package that find_package(pencilscan)
# finds. Included after all modules exist. The command line is a program, not a library.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY PENCILSCAN_MODULES)
list(FILTER libraries EXCLUDE REGEX "_cli$")

# pencilscan::pencilscan is all of it; pencilscan::<module> a part.
add_library(pencilscan_all INTERFACE)
set_target_properties(pencilscan_all PROPERTIES EXPORT_NAME pencilscan)
target_link_libraries(pencilscan_all INTERFACE ${libraries})

install(TARGETS ${libraries} pencilscan_all EXPORT pencilscan-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/pencilscan DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.h" PATTERN cli EXCLUDE)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/NOTICE
        DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(TARGET pencilscan)
  install(TARGETS pencilscan RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/pencilscan)
install(EXPORT pencilscan-targets NAMESPACE pencilscan:: DESTINATION ${package_dir})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/pencilscan-config.cmake.in
  ${PROJECT_BINARY_DIR}/pencilscan-config.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/pencilscan-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/pencilscan-config.cmake
              ${PROJECT_BINARY_DIR}/pencilscan-config-version.cmake DESTINATION ${package_dir})
