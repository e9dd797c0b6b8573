# Installs the build in BUILD_DIR below WORK_DIR, then configures, builds and runs the consumer project
# against that installation alone.
function(run_step)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "failed (${result}): ${command}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
run_step(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)
run_step(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR} -B ${WORK_DIR}/build -G ${GENERATOR}
         -D CMAKE_CXX_COMPILER=${CXX_COMPILER} -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
         -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}
         -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix -D CMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
run_step(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
# The component rig, on a computer without Ceres.
run_step(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/rig_only -B ${WORK_DIR}/build_rig_only -G ${GENERATOR}
         -D CMAKE_CXX_COMPILER=${CXX_COMPILER} -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
         -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}
         -D CMAKE_DISABLE_FIND_PACKAGE_Ceres=ON
         -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix -D CMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
run_step(${CMAKE_COMMAND} --build ${WORK_DIR}/build_rig_only)
# Only the front door and what it includes is there.
file(GLOB_RECURSE headers RELATIVE ${WORK_DIR}/prefix/include ${WORK_DIR}/prefix/include/*.h)
list(LENGTH headers count)
message("${count} headers")
foreach(inner IN ITEMS pipeline detection joint guided depth surface cli capture)
  if(EXISTS ${WORK_DIR}/prefix/include/pencilscan/${inner})
    message(FATAL_ERROR "headers of ${inner} are installed, which the front door does not need")
  endif()
endforeach()
file(MAKE_DIRECTORY ${WORK_DIR}/run)
run_step(${WORK_DIR}/build/consumer ${WORK_DIR}/prefix/bin/pencilscan ${WORK_DIR}/run)
run_step(${WORK_DIR}/build_rig_only/rig_only ${WORK_DIR}/run/rig.json)
