# pencilscan_module(<name> SOURCES ... [TESTS ...] [DEPENDS modules...] [LIBRARIES targets...] [PRIVATE_LIBRARIES targets...] [NO_PCH] [LONG_TESTS] [SHARED_SCENES suites...] [SLOW_SUITES suites...] [AGAINST_CLOCK])
# One module = one static library pencilscan_<name> (alias pencilscan::<name>) and, with tests on,
# one GoogleTest program <name>_test made of the *_test.cpp files beside the sources. CTest runs it as
# one test, <name>: to start it takes longer than most tests in it. With LONG_TESTS or AGAINST_CLOCK
# every test is one of CTest's, <name>.<suite>.<test>, so that cores share them, or one alone can be tried again. A suite whose tests share a scene
# (SetUpTestSuite) is one test, <name>.<suite>: one program makes the scene once. Those, and suites
# that take long (SLOW_SUITES), have the label slow. Sanitizers leave out single tests (script/test):
# with them every test is one, and none is slow.
function(pencilscan_target_options target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion)
  # Built elsewhere, the same bytes: checks and the debugger get paths from the sources' folder on.
  # (Not in presets for daily work, whose debuggers look for the files where they are.)
  target_compile_options(${target} PRIVATE
    $<$<CONFIG:Release>:-ffile-prefix-map=${PROJECT_SOURCE_DIR}=.>)
  # Nobody reads errno or floating-point traps: square roots and comparisons may run in registers.
  target_compile_options(${target} PRIVATE -fno-math-errno -fno-trapping-math)
  if(PENCILSCAN_HAS_AVX2)
    # No fused multiply-add: it would round otherwise than the same code elsewhere. Eigen's alignment
    # stays that of Debian's libraries. GCC 12 then sees overflows and unset values that are none.
    target_compile_options(${target} PRIVATE -march=x86-64-v3 -ffp-contract=off
                           -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread -Wno-restrict
                           -Wno-maybe-uninitialized)
    target_compile_definitions(${target} PUBLIC EIGEN_MAX_ALIGN_BYTES=16)
  endif()
  if(CMAKE_UNITY_BUILD)
    # Names of files that meet in one unit; what is private to a file looks shared in it.
    target_compile_options(${target} PRIVATE -Wno-shadow -Wno-subobject-linkage)
  endif()
  if(PENCILSCAN_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

function(pencilscan_module name)
  cmake_parse_arguments(ARG "NO_PCH;LONG_TESTS;AGAINST_CLOCK" "" "SOURCES;TESTS;DEPENDS;LIBRARIES;PRIVATE_LIBRARIES;SHARED_SCENES;SLOW_SUITES" ${ARGN})
  set(target pencilscan_${name})
  if(ARG_SOURCES)
    add_library(${target} STATIC ${ARG_SOURCES})
    set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    pencilscan_target_options(${target})
    if(NOT ARG_NO_PCH)
      pencilscan_use_pch(${target} library)
    endif()
    set(visibility PUBLIC)
  else()
    add_library(${target} INTERFACE)
    set(visibility INTERFACE)
  endif()
  add_library(pencilscan::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} ${visibility} $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
                             $<INSTALL_INTERFACE:include>)
  list(TRANSFORM ARG_DEPENDS PREPEND pencilscan::)
  target_link_libraries(${target} ${visibility} ${ARG_DEPENDS} ${ARG_LIBRARIES})
  if(ARG_PRIVATE_LIBRARIES)
    target_link_libraries(${target} PRIVATE ${ARG_PRIVATE_LIBRARIES})
  endif()
  set_property(GLOBAL APPEND PROPERTY PENCILSCAN_MODULES ${target})
  if(PENCILSCAN_BUILD_TESTS AND ARG_TESTS)
    add_executable(${name}_test ${ARG_TESTS})
    pencilscan_target_options(${name}_test)
    pencilscan_use_pch(${name}_test test)
    target_link_libraries(${name}_test PRIVATE ${target} GTest::gmock GTest::gtest_main)
    if(ARG_AGAINST_CLOCK)
      # Two may run side by side (they mostly wait) but for those with cameras on the network, which
      # lose packets then.
      foreach(suite IN ITEMS "GigE.*:Virtual.*" "-GigE.*:Virtual.*")
        set(alone TRUE)
        if(suite MATCHES "^-")
          set(alone FALSE)
        endif()
        gtest_discover_tests(${name}_test TEST_PREFIX "${name}." TEST_FILTER "${suite}" DISCOVERY_TIMEOUT 60
                             PROPERTIES TIMEOUT 300 RUN_SERIAL ${alone} LABELS clock)
      endforeach()
    elseif(ARG_LONG_TESTS)
      set(apart "")  # suites that have tests of their own
      if(NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize")
        foreach(suite IN LISTS ARG_SHARED_SCENES)
          add_test(NAME ${name}.${suite} COMMAND ${name}_test --gtest_filter=${suite}.*)
          set_tests_properties(${name}.${suite} PROPERTIES TIMEOUT 600 COST 90 LABELS "unit;slow" ENVIRONMENT GTEST_BRIEF=1
                               FAIL_REGULAR_EXPRESSION " 0 tests from 0 test suites")
        endforeach()
        set(apart ${ARG_SHARED_SCENES} ${ARG_SLOW_SUITES})
        list(TRANSFORM apart APPEND ".*")
        if(ARG_SLOW_SUITES)
          list(TRANSFORM ARG_SLOW_SUITES APPEND ".*" OUTPUT_VARIABLE slow)
          list(JOIN slow ":" slow)
          gtest_discover_tests(${name}_test TEST_PREFIX "${name}." TEST_FILTER "${slow}" DISCOVERY_TIMEOUT 60
                               PROPERTIES TIMEOUT 300 LABELS slow)
        endif()
      endif()
      list(JOIN apart ":" apart)
      gtest_discover_tests(${name}_test TEST_PREFIX "${name}." TEST_FILTER "*-${apart}" DISCOVERY_TIMEOUT 60
                           PROPERTIES TIMEOUT 300 LABELS unit)
    else()
      add_test(NAME ${name} COMMAND ${name}_test)
      set_tests_properties(${name} PROPERTIES TIMEOUT 600 LABELS unit ENVIRONMENT GTEST_BRIEF=1)
    endif()
  endif()
endfunction()
