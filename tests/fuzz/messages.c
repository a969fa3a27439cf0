/* SPDX-License-Identifier: MIT */
#include "tests/fuzz/messages.h"

#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"
#include "tests/fuzz/fuzz.h"

static size_t count_topics(void)
{
    size_t n = 0;

    while (topics_all()[n].name)
        n++;
    return n;
}

bool messages_next(struct bytes *input, const struct topic **topic, struct bytes *payload)
{
    struct bytes_cursor c = {.left = *input};

    if (input->size < 3)
        return false;
    *topic = &topics_all()[bytes_number(&c, 1) % count_topics()];
    uint64_t size = bytes_number(&c, 2);
    *payload = bytes_take(&c, size < c.left.size ? size : c.left.size);
    *input = c.left;
    return true;
}

int messages_survey(struct survey *out, Anlos__Survey *m)
{
    struct error why = {""};
    unsigned long long id;
    int err = survey_from_message(out, m, &why);
    const char *told = strstr(why.text, "that of its content, ");

    if (err && told && sscanf(told, "that of its content, %llx", &id) == 1) {
        m->id = id;
        err = survey_from_message(out, m, &why);
        FUZZ_REQUIRE(!err);
    }
    FUZZ_REQUIRE(err || (!survey_check(out, NULL) && survey_id(out) == m->id));
    return err;
}

void messages_put(struct bytes_buffer *out, const struct topic *topic,
                  struct bytes payload)
{
    bytes_put_number(out, (uint64_t)(topic - topics_all()), 1);
    bytes_put_sized(out, payload, 2);
}
