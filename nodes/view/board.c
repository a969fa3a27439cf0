#include "nodes/view/board.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>

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
