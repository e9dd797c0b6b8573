# Precompiled headers: without them a file spends most of its compile time on other projects' headers.
# Only with PENCILSCAN_PCH, which the presets for daily work turn on; presets without it (release, tidy)
# notice a file that lacks an include.
# nlohmann/json.hpp and CLI/CLI.hpp are not among them: GCC would instantiate what they leave pending
# in every file again, which takes longer than reading them where they are needed.

# What tests do themselves takes little time: to optimise it less saves a fifth of theirs to compile.
function(pencilscan_options_of_kind target kind)
  if(kind STREQUAL "test")
    target_compile_options(${target} PRIVATE $<$<CONFIG:RelWithDebInfo>:-O1>)
  endif()
endfunction()

# pencilscan_pch(<kind> LINK targets... HEADERS headers...) makes what pencilscan_use_pch(<target> <kind>)
# takes. GCC wants the same flags on both sides: a kind for libraries and one for programs; tests have their own.
function(pencilscan_pch kind)
  cmake_parse_arguments(ARG "" "" "LINK;HEADERS" ${ARGN})
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/pch/${kind}.cpp CONTENT "")
  add_library(pencilscan_${kind}_pch OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/pch/${kind}.cpp)
  pencilscan_target_options(pencilscan_${kind}_pch)
  pencilscan_options_of_kind(pencilscan_${kind}_pch ${kind})
  target_link_libraries(pencilscan_${kind}_pch PRIVATE Eigen3::Eigen opencv_core opencv_imgproc
                        ${ARG_LINK})
  target_precompile_headers(pencilscan_${kind}_pch PRIVATE
    <algorithm> <array> <cmath> <filesystem> <fstream> <functional> <map> <memory> <numbers>
    <optional> <span> <string> <vector>
    <Eigen/Core> <Eigen/Geometry> <opencv2/core.hpp> <opencv2/imgproc.hpp> ${ARG_HEADERS})
endfunction()

function(pencilscan_use_pch target kind)
  if(TARGET pencilscan_${kind}_pch)
    # ccache wants -fpch-preprocess.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
    pencilscan_options_of_kind(${target} ${kind})
    target_precompile_headers(${target} REUSE_FROM pencilscan_${kind}_pch)
  endif()
endfunction()

if(PENCILSCAN_PCH)
  pencilscan_pch(library)
  set_target_properties(pencilscan_library_pch PROPERTIES POSITION_INDEPENDENT_CODE ON)
  pencilscan_pch(program)
  if(PENCILSCAN_BUILD_TESTS)
    pencilscan_pch(test LINK GTest::gmock HEADERS <gmock/gmock.h> <gtest/gtest.h>)
  endif()
endif()
