# SPDX-License-Identifier: MIT
# cmake -D SOURCE_DIR=.. -D OUTPUT=.. -P itrCommit.cmake: a header with the commit that is built, empty outside of a repository.
# It is written only where it changes, so that nothing is compiled again for the same commit.
execute_process(COMMAND git -C ${SOURCE_DIR} describe --always --dirty --abbrev=7 --exclude=*
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(commit "")
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define ITR_COMMIT \"${commit}\"\n")
