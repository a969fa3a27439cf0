#include "nodes/view/frame.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define LENGTH_SIZE 4

struct frame {
    atomic_size_t references;
    bool binary;
    size_t size;
    uint8_t data[];
};

static struct frame *frame_create(size_t size, bool binary)
{
    struct frame *f = malloc(sizeof *f + size);

    if (!f)
        return NULL;
    atomic_init(&f->references, 1);
    f->binary = binary;
    f->size = size;
    return f;
}

/* With room for n bytes after the text, head bytes before it. */
static struct frame *with_text(json_t *text, size_t head, size_t n)
{
    char *written = text ? json_dumps(text, JSON_COMPACT | JSON_REAL_PRECISION(7)) : NULL;
    size_t length = written ? strlen(written) : 0;
    struct frame *f = written ? frame_create(head + length + n, head > 0) : NULL;

    if (f)
        memcpy(f->data + head, written, length);
    for (size_t i = 0; f && i < head; i++)
        f->data[i] = (uint8_t)(length >> 8 * i);
    free(written);
    json_decref(text);
    return f;
}

struct frame *frame_of_text(json_t *text)
{
    return with_text(text, 0, 0);
}

struct frame *frame_of_images(json_t *text, size_t image_size, uint8_t **image)
{
    struct frame *f = with_text(text, LENGTH_SIZE, image_size);

    if (f)
        *image = f->data + f->size - image_size;
    return f;
}

const uint8_t *frame_data(const struct frame *f, size_t *size, bool *binary)
{
    *size = f->size;
    *binary = f->binary;
    return f->data;
}

struct frame *frame_keep(struct frame *f)
{
    atomic_fetch_add(&f->references, 1);
    return f;
}

void frame_drop(struct frame *f)
{
    if (f && atomic_fetch_sub(&f->references, 1) == 1)
        free(f);
}
