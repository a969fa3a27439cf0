#include "nodes/anlos/doctor/findings.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/log_line.h"

static const char *const level_names[] = {"ok", "note", "wrong"};

static struct finding *add(struct findings *f)
{
    if (f->n == f->room) {
        size_t room = f->room ? 2 * f->room : 32;
        void *list = realloc(f->list, room * sizeof *f->list);
        if (!list) {
            f->full = true;
            return NULL;
        }
        f->list = list;
        f->room = room;
    }
    f->list[f->n] = (struct finding){0};
    return &f->list[f->n++];
}

void finding_add(struct findings *f, enum finding_level level, const char *area,
                 const char *format, ...)
{
    struct finding *one = add(f);
    va_list args;

    if (!one)
        return;
    one->level = level;
    snprintf(one->area, sizeof one->area, "%s", area);
    va_start(args, format);
    vsnprintf(one->what, sizeof one->what, format, args);
    va_end(args);
    log_text_clean(one->what);
}

void finding_todo(struct findings *f, const char *format, ...)
{
    va_list args;

    if (!f->n || f->full)
        return;
    struct finding *one = &f->list[f->n - 1];
    va_start(args, format);
    vsnprintf(one->todo, sizeof one->todo, format, args);
    va_end(args);
    log_text_clean(one->todo);
}

size_t findings_count(const struct findings *f, enum finding_level level)
{
    size_t n = 0;

    for (size_t i = 0; i < f->n; i++)
        n += f->list[i].level == level;
    return n;
}

void findings_print(const struct findings *f, bool colour, FILE *to)
{
    static const char *const colours[] = {"\033[32m", "\033[33m", "\033[31m"};

    for (size_t i = 0; i < f->n; i++) {
        const struct finding *one = &f->list[i];
        fprintf(to, "%s%-5s%s  %-9s  %s\n", colour ? colours[one->level] : "",
                level_names[one->level], colour ? "\033[0m" : "", one->area, one->what);
        if (one->todo[0])
            fprintf(to, "%18s-> %s\n", "", one->todo);
    }
    if (f->full)
        fprintf(to, "out of memory: some are missing\n");
    fprintf(to, "%zu wrong, %zu to note, %zu ok\n", findings_count(f, FINDING_WRONG),
            findings_count(f, FINDING_NOTE), findings_count(f, FINDING_OK));
}

json_t *findings_json(const struct findings *f)
{
    json_t *list = json_array();

    for (size_t i = 0; i < f->n; i++) {
        const struct finding *one = &f->list[i];
        json_array_append_new(list, json_pack("{ss, ss, ss, ss}", "level",
                                              level_names[one->level], "area", one->area,
                                              "what", one->what, "todo", one->todo));
    }
    return json_pack("{so, sI, sI}", "findings", list, "wrong",
                     (json_int_t)findings_count(f, FINDING_WRONG), "notes",
                     (json_int_t)findings_count(f, FINDING_NOTE));
}

int findings_add_json(struct findings *f, const json_t *o)
{
    const json_t *list = json_object_get(o, "findings"), *item;
    size_t i;

    if (!json_is_array(list))
        return -EINVAL;
    json_array_foreach(list, i, item)
    {
        const char *level, *area, *what, *todo;
        int n = FINDING_WRONG;
        if (json_unpack((json_t *)item, "{ss, ss, ss, ss}", "level", &level, "area",
                        &area, "what", &what, "todo", &todo))
            return -EINVAL;
        while (n > FINDING_OK && strcmp(level, level_names[n]))
            n--;
        finding_add(f, (enum finding_level)n, area, "%s", what);
        finding_todo(f, "%s", todo);
    }
    return 0;
}

void findings_clear(struct findings *f)
{
    free(f->list);
    *f = (struct findings){0};
}
