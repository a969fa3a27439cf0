/* nodes/view/frame.h -- what goes over the WebSocket to the page, made once and shared by
 * all pages: a JSON text, or binary: the length of a JSON text as u32, little endian, the
 * text, and the images that it describes. */
#ifndef ANLOS_NODES_VIEW_FRAME_H
#define ANLOS_NODES_VIEW_FRAME_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct frame;

/* Both take the reference to text, one to start with.  image: where image_size bytes are
 * to be written.  NULL: no memory. */
struct frame *frame_of_text(json_t *text);
struct frame *frame_of_images(json_t *text, size_t image_size, uint8_t **image);
const uint8_t *frame_data(const struct frame *f, size_t *size, bool *binary);

/* References are counted; safe in any thread.  frame_drop(NULL) is fine. */
struct frame *frame_keep(struct frame *f);
void frame_drop(struct frame *f);

#endif
