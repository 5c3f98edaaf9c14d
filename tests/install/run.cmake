# SPDX-License-Identifier: MIT
# cmake -D BUILD_DIR=.. -D SOURCE_DIR=.. -D WORK_DIR=.. -D BUILD_TYPE=.. -D GENERATOR=.. -D CXX_FLAGS=.. -P run.cmake
# Installs BUILD_DIR into a fresh prefix; configures, builds and runs against it what is somebody else's project: a consumer,
# the example of a program, and the example of a solver module, which the installed command then runs a scene with.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# Compiles at -O1, which takes less than -O3: these programs hardly compute.
function(build source name)
  run(${CMAKE_COMMAND} -S ${SOURCE_DIR}/${source} -B ${WORK_DIR}/${name} -G ${GENERATOR}
      -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix -D CMAKE_BUILD_TYPE=${BUILD_TYPE} -D "CMAKE_CXX_FLAGS=${CXX_FLAGS}"
      -D "CMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG" -D "CMAKE_C_FLAGS=${CXX_FLAGS}" -D "CMAKE_Fortran_FLAGS=${CXX_FLAGS}")
  run(${CMAKE_COMMAND} --build ${WORK_DIR}/${name})
endfunction()

# Installed in one place, moved to another, and then the build tree's modules are out of the way.
file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/first)
file(RENAME ${WORK_DIR}/first ${WORK_DIR}/prefix)
build(tests/install consumer)
set(shared ${WORK_DIR}/prefix/share)
foreach(file itr/examples/masticator.json itr/examples/render.py itr/examples/tasks/drop.json itr/study/__main__.py
        doc/itr/README.md doc/itr/docs/scenes.md doc/itr/docs/theory.md)
  if(NOT EXISTS ${shared}/${file})
    message(FATAL_ERROR "${file} is not installed")
  endif()
endforeach()

file(GLOB_RECURSE headers RELATIVE ${SOURCE_DIR}/include ${SOURCE_DIR}/include/*)
file(GLOB_RECURSE installed RELATIVE ${WORK_DIR}/prefix/include ${WORK_DIR}/prefix/include/*)
if(NOT headers STREQUAL installed)
  message(FATAL_ERROR "include/ has\n${headers}\nand these are installed:\n${installed}")
endif()
run(${WORK_DIR}/consumer/shared_consumer)

# Where program and command look for modules: in their prefix, wherever the build tree was.
file(GLOB modules ${WORK_DIR}/prefix/lib*/itr/backends/itr_backend_cholmod.so
     ${WORK_DIR}/prefix/lib/*/itr/backends/itr_backend_cholmod.so)
find_program(STRACE strace)
function(check_modules)
  if(STRACE)
    execute_process(COMMAND ${STRACE} -f -e trace=file ${ARGN} OUTPUT_VARIABLE output ERROR_VARIABLE calls
      COMMAND_ERROR_IS_FATAL ANY)
    string(FIND "${calls}" "${BUILD_DIR}/lib" in_build_tree)
    if(NOT in_build_tree EQUAL -1)
      message(FATAL_ERROR "${ARGN} looks for modules in the build tree")
    endif()
  endif()
endfunction()
foreach(program ${WORK_DIR}/prefix/bin/itr ${WORK_DIR}/consumer/consumer)
  file(STRINGS ${program} named REGEX "^${BUILD_DIR}/lib")
  if(named)
    message(FATAL_ERROR "${program} names the build tree: ${named}")
  endif()
endforeach()
run(${WORK_DIR}/consumer/consumer)
check_modules(${WORK_DIR}/prefix/bin/itr solvers)
run(${WORK_DIR}/prefix/bin/itr study --help)
if(modules)
  run(${WORK_DIR}/consumer/consumer cholmod)
  check_modules(${WORK_DIR}/consumer/consumer cholmod)
  execute_process(COMMAND ${WORK_DIR}/prefix/bin/itr solvers OUTPUT_VARIABLE solvers COMMAND_ERROR_IS_FATAL ANY)
  if(solvers MATCHES "cholmod:simplicial +absent")
    message(FATAL_ERROR "the moved command does not find its modules:\n${solvers}")
  endif()
endif()

set(scene ${shared}/itr/examples/masticator.json)
build(examples/api api)
run(${CMAKE_CTEST_COMMAND} --test-dir ${WORK_DIR}/api --output-on-failure --no-tests=error)

# The guide, as a new user goes through it.
run(${PYTHON} ${SOURCE_DIR}/tests/install/guide.py ${SOURCE_DIR} ${WORK_DIR}/guide)
run(${CMAKE_COMMAND} -S ${WORK_DIR}/guide -B ${WORK_DIR}/guide/build -G ${GENERATOR}
    -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix -D "CMAKE_CXX_FLAGS=${CXX_FLAGS}")
run(${CMAKE_COMMAND} --build ${WORK_DIR}/guide/build)
run(${WORK_DIR}/guide/build/host)

# The C example by pkg-config, and the Python package, which pip packs from the same build.
find_program(PKG_CONFIG pkg-config)
file(GLOB_RECURSE pc ${WORK_DIR}/prefix/*/itr.pc)
if(PKG_CONFIG AND pc)
  cmake_path(GET pc PARENT_PATH folder)
  set(ENV{PKG_CONFIG_PATH} ${folder})
  execute_process(COMMAND ${PKG_CONFIG} --cflags --libs itr OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE
    COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags)
  separate_arguments(more NATIVE_COMMAND "${CXX_FLAGS}")
  cmake_path(GET folder PARENT_PATH libraries)
  run(cc ${more} ${SOURCE_DIR}/examples/api/bounce.c ${flags} -lm -Wl,-rpath,${libraries} -o ${WORK_DIR}/bounce)
  run(${WORK_DIR}/bounce)
endif()
file(GLOB package ${WORK_DIR}/prefix/lib/python*/site-packages)
if(package)
  run(${CMAKE_COMMAND} -E env PYTHONPATH=${package} ${PYTHON} ${SOURCE_DIR}/tests/python_test.py ${SOURCE_DIR} Arrays)
  run(${CMAKE_COMMAND} -E env PYTHONPATH=${package} ${PYTHON} ${WORK_DIR}/guide/host.py)
  execute_process(COMMAND ${PYTHON} -m pip --version RESULT_VARIABLE no_pip OUTPUT_QUIET ERROR_QUIET)
  if(NOT no_pip)
    run(${CMAKE_COMMAND} -E env ITR_PYTHON_BUILD=${BUILD_DIR} ${PYTHON} -m pip install --quiet --no-index
        --no-build-isolation --no-deps --target ${WORK_DIR}/pip ${SOURCE_DIR})
    run(${CMAKE_COMMAND} -E env PYTHONPATH=${WORK_DIR}/pip ${PYTHON} ${SOURCE_DIR}/tests/python_test.py ${SOURCE_DIR} Arrays)
    if(modules)  # the wheel brings its own
      set(program "__import__('itr').Simulation(__import__('itr').Model.from_scene('${scene}', {'/solver/linear/solver': 'cholmod'})).step()")
      run(${CMAKE_COMMAND} -E env PYTHONPATH=${WORK_DIR}/pip ${PYTHON} -c ${program})
    endif()
  endif()
endif()

build(examples/custom_backend custom_backend)
set(itr ${WORK_DIR}/prefix/bin/itr)
set(ENV{ITR_BACKEND_PATH} ${WORK_DIR}/custom_backend)
run(${itr} run ${scene} --solver example:cg --set /time/tend=1.5 -o ${WORK_DIR}/own --overwrite)
run(${itr} run ${scene} --solver eigen --set /time/tend=1.5 -o ${WORK_DIR}/eigen --overwrite)
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
