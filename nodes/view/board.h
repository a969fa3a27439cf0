/* SPDX-License-Identifier: MIT */
/* nodes/view/board.h -- what every open page is to show: one frame for each subject, the
 * newest in place of the one before.  A page that is slow finds newer frames when it
 * comes back and skips those between: it costs no memory and keeps nobody waiting. */
#ifndef ANLOS_NODES_VIEW_BOARD_H
#define ANLOS_NODES_VIEW_BOARD_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What goes over the WebSocket to the page, made once and shared by all pages: a JSON
 * text, or binary: the length of a JSON text as u32, little endian, the text, and the
 * images that it describes. */

struct frame;

/* Both take the reference to text, one to start with.  image: where image_size bytes are
 * to be written.  NULL: no memory. */
struct frame *frame_of_text(json_t *text);
struct frame *frame_of_images(json_t *text, size_t image_size, uint8_t **image);
const uint8_t *frame_data(const struct frame *f, size_t *size, bool *binary);

/* References are counted; safe in any thread.  frame_drop(NULL) is fine. */
void frame_drop(struct frame *f);

enum board_subject {
    BOARD_HELLO,
    BOARD_TIMELINE,
    BOARD_SCENE,
    BOARD_SCAN,
    BOARD_STAGE,
    BOARD_CLOCK,
    BOARD_NODES,
    BOARD_WALLS,
    BOARD_OBJECTS,
    BOARD_HISTORY,
    BOARD_RECORD,
    BOARD_LEVELS,
    BOARD_LOG,
    BOARD_VOLUME,
    BOARD_TIME,
    BOARD_SUBJECTS
};

struct board;

int board_create(struct board **out); /* 0, -ENOMEM */

/* changed is called, in the poster's thread, after every post; NULL: nobody is any more.
 */
void board_watch(struct board *b, void (*changed)(void *ctx), void *ctx);

/* f, which becomes the board's, is what the subject shows from now on.  NULL: it could
 * not be made, and the one before stays. */
void board_post(struct board *b, enum board_subject subject, struct frame *f);

/* A page that reads the board; starts as {0}. */
struct board_reader {
    uint64_t seen[BOARD_SUBJECTS];
    struct frame *handed;
};

/* Gives a reader a frame of its own, in place of one that it has not fetched. */
void board_hand(struct board *b, struct board_reader *r, struct frame *f);

/* Something that the reader has not seen; a reference of the caller's.  NULL: there is
 * nothing. */
struct frame *board_next(struct board *b, struct board_reader *r);

/* Drops what the reader was given and has not fetched. */
void board_close(struct board *b, struct board_reader *r);

/* Frames that were replaced before a reader came for them, of all readers. */
uint64_t board_skipped(struct board *b);
void board_destroy(struct board *b);

#endif
