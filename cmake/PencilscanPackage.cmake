# Debian packages of the installed components, by cpack: pencilscan, libpencilscan-dev,
# python3-pencilscan and pencilscan-doc. script/package builds, checks and names them.
set(PENCILSCAN_MAINTAINER "The pencilscan authors <maintainers@pencilscan.example>" CACHE STRING
    "Who answers for the packages: name <address>")
set(PENCILSCAN_HOMEPAGE "" CACHE STRING "Where the project is found, for the packages")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR pencilscan)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ
    GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program development documents)
if(TARGET pencilscan_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${PENCILSCAN_MAINTAINER})
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE ${PENCILSCAN_HOMEPAGE})
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# pencilscan_package(<component> <package> <section> <short text> <long text>) names and describes a
# package, and gives it what Debian wants in /usr/share/doc/<package>.
string(TIMESTAMP packaged_on "%a, %d %b %Y %H:%M:%S +0000" UTC)
function(pencilscan_package component package section summary text)
  string(TOUPPER ${component} name)
  set(CPACK_DEBIAN_${name}_PACKAGE_NAME ${package} PARENT_SCOPE)
  set(CPACK_DEBIAN_${name}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${name}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  set(folder ${PROJECT_BINARY_DIR}/debian/${package})
  configure_file(${PROJECT_SOURCE_DIR}/cmake/debian/changelog.in ${folder}/changelog.Debian @ONLY)
  file(COPY_FILE ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${folder}/changelog ONLY_IF_DIFFERENT)
  foreach(file IN ITEMS changelog changelog.Debian)
    execute_process(COMMAND gzip -9 --no-name --force ${folder}/${file} COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  install(FILES ${folder}/changelog.gz ${folder}/changelog.Debian.gz
                ${PROJECT_SOURCE_DIR}/cmake/debian/copyright
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
endfunction()

pencilscan_package(program pencilscan science "Entire shapes from one frame of cameras and projectors"
"A ring of cameras and projectors stands around an object, each projector
shows parallel lines, and every camera takes one picture. This program
plans and calibrates such rigs, simulates frames, reconstructs the entire
shape from each frame, and measures the result.")
# What is loaded when it is first needed is not among what dpkg-shlibdeps sees: libopencv_x.so.1 is of libopencv-x1.
string(REGEX REPLACE "^lib(.*)_(.*)\\.so\\.(.*)$" "lib\\1-\\2\\3" codecs ${PENCILSCAN_IMGCODECS})
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS ${codecs})
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "pencilscan-doc, povray")

pencilscan_package(development libpencilscan-dev libdevel "Entire shapes from one frame (C++ development files)"
"Headers, static libraries and the CMake package of pencilscan, which
reconstructs entire shapes from one frame of a ring of cameras and
projectors: rigs, simulation, calibration, reconstruction, evaluation.")
# What pencilscan-config.cmake looks for.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libassimp-dev, libblosc-dev, libceres-dev, libdeflate-dev, libeigen3-dev, libembree-dev, libopencv-dev, libtbb-dev, nlohmann-json3-dev, zlib1g-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "pencilscan-doc, cmake")

pencilscan_package(python python3-pencilscan python "Entire shapes from one frame (Python 3)"
"NumPy arrays in and out of pencilscan, which reconstructs entire shapes
from one frame of a ring of cameras and projectors: rigs, simulation,
calibration, reconstruction, evaluation.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
math(EXPR next_python "${Python_VERSION_MINOR} + 1")
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_python}), python3-numpy, ${codecs}")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS pencilscan-doc)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/cmake/debian/prerm)

pencilscan_package(documents pencilscan-doc doc "Entire shapes from one frame (documents)"
"Documents of pencilscan, which reconstructs entire shapes from one frame
of a ring of cameras and projectors: guides, file formats, figures, the
C++ and Python interfaces, and examples.")
set(CPACK_DEBIAN_DOCUMENTS_PACKAGE_ARCHITECTURE all)

# Copyrights of what is compiled into the libraries, the program and the Python module.
set(copyrights ${PROJECT_BINARY_DIR}/debian/copyright.compiled-in)
file(WRITE ${copyrights} "")
foreach(package IN ITEMS libceres-dev libcli11-dev libeigen3-dev nlohmann-json3-dev pybind11-dev)
  if(EXISTS /usr/share/doc/${package}/copyright)
    file(READ /usr/share/doc/${package}/copyright copyright)
    file(APPEND ${copyrights} "==== ${package}\n\n${copyright}\n")
  endif()
endforeach()
install(FILES ${copyrights} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/pencilscan
        COMPONENT program EXCLUDE_FROM_ALL)
install(FILES ${copyrights} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libpencilscan-dev
        COMPONENT development EXCLUDE_FROM_ALL)
install(FILES ${copyrights} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-pencilscan
        COMPONENT python EXCLUDE_FROM_ALL)
install(FILES ${PROJECT_SOURCE_DIR}/web/node_modules/three/LICENSE RENAME copyright.three
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/pencilscan COMPONENT program EXCLUDE_FROM_ALL)

include(CPack)
