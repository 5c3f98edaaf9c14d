# SPDX-License-Identifier: MIT
# usage: cmake -D FOLDER=src/apps/report/page -D OUTPUT=FILE.cpp -P embed.cmake: the page's files as constants of C++.
cmake_policy(VERSION 3.25)
set(SCRIPTS data.js draw.js plots.js view.js study.js page.js)
set(text "#include \"apps/report/assets.hpp\"\nnamespace itr::report::assets {\n")

function(add_constant name)
  set(literals "")
  foreach(file IN LISTS ARGN)
    file(READ "${FOLDER}/${file}" content)
    # A literal of some compilers has at most 16 kB; what stands side by side is one.
    string(LENGTH "${content}" length)
    set(at 0)
    while(at LESS length)
      string(SUBSTRING "${content}" ${at} 8000 part)
      string(APPEND literals "R\"~itr~(${part})~itr~\"\n")
      math(EXPR at "${at} + 8000")
    endwhile()
  endforeach()
  set(text "${text}const std::string_view ${name} =\n${literals};\n" PARENT_SCOPE)
endfunction()

add_constant(page page.html)
add_constant(style style.css)
add_constant(script ${SCRIPTS})
file(WRITE "${OUTPUT}" "${text}}  // namespace itr::report::assets\n")
