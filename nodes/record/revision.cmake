# SPDX-License-Identifier: MIT
# Writes OUT with the git revision of the sources in SOURCE, "-dirty" when they differ from
# it, or VERSION where there is no git: at each build, touching OUT only when it changes.
execute_process(COMMAND git describe --always --abbrev=12 --dirty --exclude=*
    WORKING_DIRECTORY ${SOURCE} OUTPUT_VARIABLE revision RESULT_VARIABLE failed
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(failed OR NOT revision)
    set(revision ${VERSION})
endif()
set(text "#define ANLOS_REVISION \"${revision}\"\n")
set(before "")
if(EXISTS ${OUT})
    file(READ ${OUT} before)
endif()
if(NOT text STREQUAL before)
    file(WRITE ${OUT} "${text}")
endif()
