# SPDX-License-Identifier: MIT
# itr_add_backend(NAME SOURCES...): a loadable solver module `itr_backend_NAME`, for our own folders backends/*.
function(itr_add_backend name)
  set(target itr_backend_${name})
  add_library(${target} MODULE ${ARGN})
  target_link_libraries(${target} PRIVATE itr::module ${CMAKE_DL_LIBS})
  if(NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize")
    target_link_options(${target} PRIVATE LINKER:-z,defs)  # what is missing is seen here, not when a user loads it
  endif()
  set_target_properties(${target} PROPERTIES PREFIX "" CXX_VISIBILITY_PRESET hidden
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/itr/backends)
  install(TARGETS ${target} LIBRARY DESTINATION ${ITR_BACKEND_DIR} COMPONENT backends)
  set_property(GLOBAL APPEND PROPERTY ITR_SOLVER_MODULES ${target})
  message(STATUS "solver module ${name}: will be built")
endfunction()

# itr_add_suitesparse(NAME): the module over SuiteSparse's library NAME, of NAME_backend.cpp; none where that is missing, and
# `itr solvers` says so.
function(itr_add_suitesparse name)
  string(TOUPPER ${name} NAME)
  find_path(ITR_${NAME}_INCLUDE ${name}.h PATH_SUFFIXES suitesparse)
  find_library(ITR_${NAME}_LIBRARY ${name})
  if(NOT ITR_${NAME}_INCLUDE OR NOT ITR_${NAME}_LIBRARY)
    message(STATUS "solver module ${name}: absent (install libsuitesparse-dev)")
    return()
  endif()
  itr_add_backend(${name} ${name}_backend.cpp)
  target_include_directories(itr_backend_${name} SYSTEM PRIVATE ${ITR_${NAME}_INCLUDE})
  target_link_libraries(itr_backend_${name} PRIVATE ${ITR_${NAME}_LIBRARY})
endfunction()
