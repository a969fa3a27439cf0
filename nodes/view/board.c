/* SPDX-License-Identifier: MIT */
#include "nodes/view/board.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/json_whole.h"

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
    char *written =
        json_whole(text) ? json_dumps(text, JSON_COMPACT | JSON_REAL_PRECISION(7)) : NULL;
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

static struct frame *frame_keep(struct frame *f)
{
    atomic_fetch_add(&f->references, 1);
    return f;
}

void frame_drop(struct frame *f)
{
    if (f && atomic_fetch_sub(&f->references, 1) == 1)
        free(f);
}

struct board {
    pthread_mutex_t lock;
    struct frame *frames[BOARD_SUBJECTS];
    uint64_t version[BOARD_SUBJECTS]; /* counts the frames of a subject */
    uint64_t skipped;
    void (*changed)(void *ctx); /* NULL: nobody watches */
    void *ctx;
};

int board_create(struct board **out)
{
    struct board *b = calloc(1, sizeof *b);

    if (!b)
        return -ENOMEM;
    pthread_mutex_init(&b->lock, NULL);
    *out = b;
    return 0;
}

void board_watch(struct board *b, void (*changed)(void *ctx), void *ctx)
{
    pthread_mutex_lock(&b->lock);
    b->changed = changed;
    b->ctx = ctx;
    pthread_mutex_unlock(&b->lock);
}

static void tell(struct board *b)
{
    if (b->changed)
        b->changed(b->ctx);
}

void board_post(struct board *b, enum board_subject subject, struct frame *f)
{
    if (!f)
        return;
    pthread_mutex_lock(&b->lock);
    struct frame *before = b->frames[subject];
    b->frames[subject] = f;
    b->version[subject]++;
    tell(b);
    pthread_mutex_unlock(&b->lock);
    frame_drop(before);
}

void board_hand(struct board *b, struct board_reader *r, struct frame *f)
{
    pthread_mutex_lock(&b->lock);
    struct frame *before = r->handed;
    b->skipped += before != NULL;
    r->handed = f;
    tell(b);
    pthread_mutex_unlock(&b->lock);
    frame_drop(before);
}

static struct frame *take(struct board *b, struct board_reader *r)
{
    struct frame *f = r->handed;

    r->handed = NULL;
    for (int i = 0; !f && i < BOARD_SUBJECTS; i++) {
        if (r->seen[i] == b->version[i])
            continue;
        if (r->seen[i]) /* those before it came are none that it missed */
            b->skipped += b->version[i] - r->seen[i] - 1;
        r->seen[i] = b->version[i];
        f = frame_keep(b->frames[i]);
    }
    return f;
}

struct frame *board_next(struct board *b, struct board_reader *r)
{
    pthread_mutex_lock(&b->lock);
    struct frame *f = take(b, r);
    pthread_mutex_unlock(&b->lock);
    return f;
}

void board_close(struct board *b, struct board_reader *r)
{
    pthread_mutex_lock(&b->lock);
    frame_drop(r->handed);
    r->handed = NULL;
    pthread_mutex_unlock(&b->lock);
}

uint64_t board_skipped(struct board *b)
{
    pthread_mutex_lock(&b->lock);
    uint64_t n = b->skipped;
    pthread_mutex_unlock(&b->lock);
    return n;
}

void board_destroy(struct board *b)
{
    if (!b)
        return;
    for (int i = 0; i < BOARD_SUBJECTS; i++)
        frame_drop(b->frames[i]);
    pthread_mutex_destroy(&b->lock);
    free(b);
}
