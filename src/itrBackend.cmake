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
  install(TARGETS ${target} LIBRARY DESTINATION ${ITR_BACKEND_DIR})
  message(STATUS "solver module ${name}: will be built")
endfunction()
