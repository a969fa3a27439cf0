#include "hal/yaml/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/yaml/check.h"
#include "hal/yaml/depth.h"

struct bytes {
    unsigned char *data;
    size_t size;
};

static int read_whole(int fd, struct bytes *out)
{
    struct stat st;
    if (fstat(fd, &st) < 0)
        return -errno;
    if (S_ISDIR(st.st_mode))
        return -EISDIR;
    if (!S_ISREG(st.st_mode))
        return -EINVAL;
    if (st.st_size > (off_t)YAML_FILE_MAX_SIZE)
        return -EFBIG;
    size_t room = (size_t)st.st_size;
    out->data = malloc(room + 1);
    if (!out->data)
        return -ENOMEM;
    while (out->size < room) {
        ssize_t n = read(fd, out->data + out->size, room - out->size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return -errno;
        if (!n)
            break;
        out->size += (size_t)n;
    }
    return 0;
}

static int read_file(const char *path, struct bytes *out, struct complaint *why)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) {
        int err = -errno;
        return complain(why, err, "%s: %s", path, strerror(-err));
    }
    int err = read_whole(fd, out);
    close(fd);
    if (err == -EINVAL)
        return complain(why, err, "%s: not a regular file", path);
    if (err == -EFBIG)
        return complain(why, err, "%s: larger than %u bytes", path, YAML_FILE_MAX_SIZE);
    if (err)
        return complain(why, err, "%s: %s", path, strerror(-err));
    return 0;
}

static int check(const unsigned char *text, size_t size,
                 const struct cyaml_schema_value *schema, const char *path,
                 struct complaint *why)
{
    yaml_parser_t parser;
    yaml_document_t document, more;
    int err = yaml_check_depth(text, size, path, why);
    if (err)
        return err;
    if (!yaml_parser_initialize(&parser))
        return complain(why, -ENOMEM, "%s: out of memory", path);
    yaml_parser_set_input_string(&parser, text, size);
    if (!yaml_parser_load(&parser, &document)) {
        size_t line = parser.problem_mark.line ? parser.problem_mark.line
                                               : parser.context_mark.line;
        err = complain(why, -EINVAL, "%s:%zu: not YAML: %s", path, line + 1,
                       parser.problem ? parser.problem : "cannot be read");
        goto parser;
    }
    err = yaml_check(&document, schema, path, why);
    yaml_document_delete(&document);
    if (err)
        goto parser;
    if (!yaml_parser_load(&parser, &more)) {
        err = complain(why, -EINVAL, "%s:%zu: not YAML: %s", path,
                       parser.problem_mark.line + 1, parser.problem);
        goto parser;
    }
    const yaml_node_t *root = yaml_document_get_root_node(&more);
    if (root)
        err = complain(why, -EINVAL, "%s:%zu: expected one document, here begins another",
                       path, root->start_mark.line + 1);
    yaml_document_delete(&more);
parser:
    yaml_parser_delete(&parser);
    return err;
}

/* The first error that libcyaml logs says what, the first place of its backtrace says
 * where; the rest repeats. */
struct cyaml_notes {
    char what[256];
    size_t line;
};

static void take_note(cyaml_log_t level, void *ctx, const char *format, va_list args)
{
    struct cyaml_notes *notes = ctx;
    char text[256];
    if (level < CYAML_LOG_ERROR)
        return;
    vsnprintf(text, sizeof text, format, args);
    text[strcspn(text, "\n")] = 0;
    const char *line = strstr(text, "(line: ");
    if (line && !notes->line)
        notes->line = strtoul(line + strlen("(line: "), NULL, 10);
    else if (!line && !notes->what[0] && !strstr(text, "Backtrace"))
        snprintf(notes->what, sizeof notes->what, "%s", text);
}

static cyaml_config_t config_of(struct cyaml_notes *notes)
{
    return (cyaml_config_t){.log_fn = notes ? take_note : NULL,
                            .log_ctx = notes,
                            .mem_fn = cyaml_mem,
                            .log_level = CYAML_LOG_ERROR,
                            .flags = CYAML_CFG_NO_ALIAS};
}

static int load(const unsigned char *text, size_t size,
                const struct cyaml_schema_value *schema, const char *path, void **out,
                struct complaint *why)
{
    struct cyaml_notes notes = {.line = 0};
    cyaml_config_t config = config_of(&notes);
    cyaml_err_t e = cyaml_load_data(text, size, &config, schema, out, NULL);
    if (e == CYAML_ERR_OOM)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    if (e != CYAML_OK)
        return complain(why, -EINVAL, "%s:%zu: %s", path, notes.line ? notes.line : 1,
                        notes.what[0] ? notes.what : cyaml_strerror(e));
    if (!*out) /* all keys are optional, and none is there */
        *out = cyaml_mem(NULL, NULL, schema->data_size);
    else
        return 0;
    if (!*out)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    memset(*out, 0, schema->data_size);
    return 0;
}

int yaml_parse(const char *path, const void *data, size_t size,
               const struct cyaml_schema_value *schema, void **out, struct complaint *why)
{
    *out = NULL;
    if (size > YAML_FILE_MAX_SIZE)
        return complain(why, -EFBIG, "%s: larger than %u bytes", path,
                        YAML_FILE_MAX_SIZE);
    int err = check(data, size, schema, path, why);
    return err ? err : load(data, size, schema, path, out, why);
}

int yaml_load(const char *path, const struct cyaml_schema_value *schema, void **out,
              struct complaint *why)
{
    struct bytes text = {.data = NULL};
    *out = NULL;
    int err = read_file(path, &text, why);
    if (!err)
        err = yaml_parse(path, text.data, text.size, schema, out, why);
    free(text.data);
    return err;
}

void yaml_unload(const struct cyaml_schema_value *schema, void *data)
{
    cyaml_config_t config = config_of(NULL);
    if (data)
        cyaml_free(&config, schema, data, 0);
}

char *yaml_sibling(const char *path, const char *name)
{
    const char *slash = strrchr(path, '/');
    if (name[0] == '/' || !slash)
        return strdup(name);
    size_t folder = (size_t)(slash - path) + 1;
    char *out = malloc(folder + strlen(name) + 1);
    if (!out)
        return NULL;
    memcpy(out, path, folder);
    strcpy(out + folder, name);
    return out;
}
