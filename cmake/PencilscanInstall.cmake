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
# Of the headers, <pencilscan/pencilscan.h> and what it includes.
set(public_headers "")
set(unread pencilscan/pencilscan.h)
while(unread)
  list(POP_FRONT unread header)
  if(header IN_LIST public_headers)
    continue()
  endif()
  list(APPEND public_headers ${header})
  set(file ${PROJECT_SOURCE_DIR}/src/${header})
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(STRINGS ${file} includes REGEX "^#include \"pencilscan/")
  list(TRANSFORM includes REPLACE "^#include \"(.*)\".*$" "\\1")
  list(APPEND unread ${includes})
endwhile()
foreach(header IN LISTS public_headers)
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/src/${header}
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder})
endforeach()
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
