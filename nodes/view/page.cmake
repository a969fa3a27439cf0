# SPDX-License-Identifier: MIT
# Writes OUT, a C file with the table of nodes/view/server.h, from the page's files (FILES,
# names in the folder SOURCE, commas between):
#   cmake -DSOURCE=.. -DFILES=index.html,.. -DOUT=.. -P page.cmake
string(REPLACE "," ";" files "${FILES}")
set(type_html "text/html; charset=utf-8")
set(type_css "text/css; charset=utf-8")
set(type_js "text/javascript; charset=utf-8")
set(type_svg "image/svg+xml")
set(arrays "")
set(rows "")
set(number 0)
foreach(file ${files})
    string(REGEX REPLACE ".*[.]" "" ending "${file}")
    file(READ "${SOURCE}/${file}" hex HEX)
    string(REGEX REPLACE "(................................)" "\\1\n    " hex "${hex}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
    string(APPEND arrays "static const uint8_t file_${number}[] = {\n    ${hex}};\n")
    set(row "\"${type_${ending}}\", file_${number}, sizeof file_${number}},\n")
    string(APPEND rows "    {\"/${file}\", ${row}")
    if(file STREQUAL "index.html")
        string(APPEND rows "    {\"/\", ${row}")
    endif()
    math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUT}" "/* Written by nodes/view/page.cmake. */\n"
    "#include \"nodes/view/server.h\"\n\n${arrays}\n"
    "const struct page_file page_files[] = {\n${rows}    {0},\n};\n")
