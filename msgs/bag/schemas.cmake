# Writes OUT, a C file with the table of msgs/bag/schema_table.h, from schema files
# (PROTOS, paths under SOURCE, commas between) by way of their descriptor sets:
#   cmake -DPROTOC_C=.. -DSOURCE=.. -DPROTOS=msgs/a.proto,.. -DOUT=.. -P schemas.cmake
string(REPLACE "," ";" protos "${PROTOS}")
set(arrays "")
set(rows "")
set(number 0)
foreach(proto ${protos})
    execute_process(COMMAND "${PROTOC_C}" --include_imports
        "--descriptor_set_out=${OUT}.set" "--proto_path=${SOURCE}" "${proto}"
        WORKING_DIRECTORY "${SOURCE}" RESULT_VARIABLE failed)
    if(failed)
        message(FATAL_ERROR "${proto}: no descriptor set")
    endif()
    file(READ "${OUT}.set" hex HEX)
    file(REMOVE "${OUT}.set")
    string(REGEX REPLACE "(................................)" "\\1\n    " hex "${hex}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
    string(APPEND arrays "static const uint8_t set_${number}[] = {\n    ${hex}};\n")
    file(STRINGS "${SOURCE}/${proto}" lines REGEX "^(package|message) ")
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
    "#include \"msgs/bag/schema_table.h\"\n\n${arrays}\n"
    "const struct bag_schema_entry bag_schema_table[] = {\n${rows}    {0},\n};\n")
