/* nodes/view/request.h -- what a page asks for: a JSON text of one key,
 * {"slice": K}: the slice at depth index K of the newest image;
 * {"seek": S}: of a bag, the state S seconds after its start. */
#ifndef ANLOS_NODES_VIEW_REQUEST_H
#define ANLOS_NODES_VIEW_REQUEST_H

#include <stddef.h>

#define REQUEST_MAX_SIZE 256

enum request_kind { REQUEST_SLICE, REQUEST_SEEK };

struct request {
    enum request_kind kind;
    size_t slice;
    double seek_s;
};

/* data[size] need not end with a zero.  0, -EINVAL, -EMSGSIZE, -ENOMEM. */
int request_parse(struct request *out, const void *data, size_t size);

#endif
