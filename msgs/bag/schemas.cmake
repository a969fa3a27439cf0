# SPDX-License-Identifier: MIT
# Writes OUT, a C file with a TABLE as in msgs/bag/schemas.h, from schema files
# (PROTOS, paths under the first of SOURCES, where imports are looked for; commas between)
# by way of their descriptor sets:
#   cmake -DPROTOC_C=.. -DSOURCES=.. -DPROTOS=msgs/a.proto,.. -DTABLE=.. -DOUT=..
#       -P schemas.cmake
string(REPLACE "," ";" protos "${PROTOS}")
string(REPLACE "," ";" sources "${SOURCES}")
list(GET sources 0 source)
list(TRANSFORM sources PREPEND --proto_path=)
set(arrays "")
set(rows "")
set(number 0)
foreach(proto ${protos})
    execute_process(COMMAND "${PROTOC_C}" --include_imports
        "--descriptor_set_out=${OUT}.set" ${sources} "${proto}"
        WORKING_DIRECTORY "${source}" RESULT_VARIABLE failed)
    if(failed)
        message(FATAL_ERROR "${proto}: no descriptor set")
    endif()
    file(READ "${OUT}.set" hex HEX)
    file(REMOVE "${OUT}.set")
    string(REGEX REPLACE "(................................)" "\\1\n    " hex "${hex}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
    string(APPEND arrays "static const uint8_t set_${number}[] = {\n    ${hex}};\n")
    file(STRINGS "${source}/${proto}" lines REGEX "^(package|message) ")
    set(package "")
    foreach(line ${lines})
        if(line MATCHES "^package +([A-Za-z0-9_.]+)")
            set(package "${CMAKE_MATCH_1}.")
        elseif(line MATCHES "^message +([A-Za-z0-9_]+)")
            string(APPEND rows "    {\"${package}${CMAKE_MATCH_1}\", set_${number}, "
                "sizeof set_${number}},\n")
        endif()
    endforeach()
    math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUT}" "/* Written by msgs/bag/schemas.cmake. */\n"
    "#include \"msgs/bag/schemas.h\"\n\n${arrays}\n"
    "const struct bag_schema_entry ${TABLE}[] = {\n${rows}    {0},\n};\n")
