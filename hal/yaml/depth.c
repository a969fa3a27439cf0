#include "hal/yaml/depth.h"

#include <errno.h>
#include <stdbool.h>

#include <yaml.h>

static int step(yaml_event_type_t type)
{
    switch (type) {
    case YAML_SEQUENCE_START_EVENT:
    case YAML_MAPPING_START_EVENT:
        return 1;
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT:
        return -1;
    default:
        return 0;
    }
}

int yaml_check_depth(const unsigned char *text, size_t size, const char *path,
                     struct complaint *why)
{
    yaml_parser_t parser;
    yaml_event_t event;
    int depth = 0;
    bool more = true;

    if (!yaml_parser_initialize(&parser))
        return complain(why, -ENOMEM, "%s: out of memory", path);
    yaml_parser_set_input_string(&parser, text, size);
    while (more && depth <= YAML_MAX_DEPTH && yaml_parser_parse(&parser, &event)) {
        depth += step(event.type);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    size_t line = parser.mark.line + 1;
    yaml_parser_delete(&parser);
    return depth <= YAML_MAX_DEPTH
               ? 0
               : complain(why, -EINVAL, "%s:%zu: more than %d levels deep", path, line,
                          YAML_MAX_DEPTH);
}
