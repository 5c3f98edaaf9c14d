# SPDX-License-Identifier: MIT
# What a program may include: these, and what they include. The other headers of include/ are the library's own.
cmake_policy(VERSION 3.25)
set(ITR_PUBLIC_HEADERS itr/itr.hpp itr/itr.h
  itr/energy/contact/contact.hpp itr/projection/transfer.hpp itr/remesh/remesher.hpp  # parts that are of use alone
  itr/linear/abi.h itr/linear/iteration_options.hpp itr/linear/module_adapter.hpp)    # for solver modules

# Those below the folder `include`, with all that they include.
function(itr_public_headers include result)
  set(found)
  set(open ${ITR_PUBLIC_HEADERS})
  while(open)
    list(POP_FRONT open header)
    if(NOT header IN_LIST found)
      list(APPEND found ${header})
      file(STRINGS ${include}/${header} lines REGEX "^ *# *include *[\"<]itr/")
      foreach(line IN LISTS lines)
        string(REGEX REPLACE "^.*[\"<](itr/[^\">]*)[\">].*$" "\\1" included "${line}")
        list(APPEND open ${included})
      endforeach()
    endif()
  endwhile()
  list(SORT found)
  set(${result} ${found} PARENT_SCOPE)
endfunction()
