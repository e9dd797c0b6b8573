# Installs what packages hold, each file with the component that is its package: program, development,
# python (python/CMakeLists.txt), documents. Included after all modules exist.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# The modules that the front door is made of: what it links, and what that links.
set(libraries "")
set(unread pencilscan_api)
while(unread)
  list(POP_FRONT unread library)
  list(APPEND libraries ${library})
  get_target_property(linked ${library} INTERFACE_LINK_LIBRARIES)
  list(TRANSFORM linked REPLACE "^pencilscan::" "pencilscan_")
  list(FILTER linked INCLUDE REGEX "^pencilscan_")
  list(REMOVE_ITEM linked ${libraries})
  list(APPEND unread ${linked})
  list(REMOVE_DUPLICATES unread)
endwhile()

# pencilscan::pencilscan is all of it; pencilscan::<module> a part.
add_library(pencilscan_all INTERFACE)
set_target_properties(pencilscan_all PROPERTIES EXPORT_NAME pencilscan)
target_link_libraries(pencilscan_all INTERFACE ${libraries})

install(TARGETS ${libraries} pencilscan_all EXPORT pencilscan-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
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
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder} COMPONENT development)
endforeach()
# (Debian's packages have no file LICENSE: their copyright says where the text is.)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT licence)
install(FILES ${PROJECT_SOURCE_DIR}/NOTICE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(TARGETS pencilscan RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
if(TARGET pencilscan_written)
  set(written ${PROJECT_BINARY_DIR}/written)
  install(DIRECTORY ${written}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT program)
  install(FILES ${written}/pencilscan COMPONENT program
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
  install(FILES ${written}/_pencilscan COMPONENT program
          DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)
endif()

set(documents ${CMAKE_INSTALL_DATADIR}/doc/pencilscan-doc)
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/SECURITY.md
        DESTINATION ${documents} COMPONENT documents)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${documents} COMPONENT documents
        PATTERN site EXCLUDE)
# The site, where script/docs built it.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/build/docs/html DESTINATION ${documents} COMPONENT documents OPTIONAL
        PATTERN .doctrees EXCLUDE PATTERN .buildinfo EXCLUDE)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/python/examples DESTINATION ${documents} COMPONENT documents
        FILES_MATCHING PATTERN *.py)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/pencilscan)
install(EXPORT pencilscan-targets NAMESPACE pencilscan::
        DESTINATION ${package_dir} COMPONENT development)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/pencilscan-config.cmake.in
  ${PROJECT_BINARY_DIR}/pencilscan-config.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/pencilscan-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/pencilscan-config.cmake
              ${PROJECT_BINARY_DIR}/pencilscan-config-version.cmake
        DESTINATION ${package_dir} COMPONENT development)
