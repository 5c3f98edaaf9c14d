# SPDX-License-Identifier: MIT
# cmake -D BUILD_DIR=.. -D SOURCE_DIR=.. -D WORK_DIR=.. -D BUILD_TYPE=.. -D GENERATOR=.. -D CXX_FLAGS=.. -P run.cmake
# Installs BUILD_DIR into a fresh prefix; configures, builds and runs against it what is somebody else's project: a consumer,
# the example of a program, and the example of a solver module, which the installed command then runs a scene with.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

function(build source name)
  run(${CMAKE_COMMAND} -S ${SOURCE_DIR}/${source} -B ${WORK_DIR}/${name} -G ${GENERATOR}
      -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix -D CMAKE_BUILD_TYPE=${BUILD_TYPE} -D "CMAKE_CXX_FLAGS=${CXX_FLAGS}")
  run(${CMAKE_COMMAND} --build ${WORK_DIR}/${name})
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)
build(tests/install consumer)
run(${WORK_DIR}/consumer/consumer)

set(scene ${SOURCE_DIR}/examples/masticator.json)
build(examples/api api)
run(${WORK_DIR}/api/own_solver ${scene} 30)

build(examples/custom_backend custom_backend)
set(itr ${WORK_DIR}/prefix/bin/itr)
set(ENV{ITR_BACKEND_PATH} ${WORK_DIR}/custom_backend)
run(${itr} run ${scene} --solver example:cg --set /time/tend=1.5 -o ${WORK_DIR}/own)
run(${itr} run ${scene} --solver eigen --set /time/tend=1.5 -o ${WORK_DIR}/eigen)
# The same steps: mesh and energy, to what a Newton solve leaves open.
foreach(folder own eigen)
  file(STRINGS ${WORK_DIR}/${folder}/steps.jsonl lines)
  list(GET lines -1 line)
  foreach(key step vertices elements)
    string(JSON ${folder}_${key} GET "${line}" ${key})
  endforeach()
  string(JSON ${folder}_total GET "${line}" energy total)
  string(REGEX MATCH "^[0-9]+\\.[0-9][0-9]" ${folder}_total ${${folder}_total})
endforeach()
foreach(key step vertices elements total)
  if(NOT own_${key} STREQUAL eigen_${key} OR own_${key} STREQUAL "")
    message(FATAL_ERROR "${key} is ${own_${key}} with example:cg and ${eigen_${key}} with eigen")
  endif()
endforeach()
