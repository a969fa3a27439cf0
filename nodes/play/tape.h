/* nodes/play/tape.h -- the messages of a bag that are to be played, in the order of their
 * publish stamps, from any time on. */
#ifndef ANLOS_NODES_PLAY_TAPE_H
#define ANLOS_NODES_PLAY_TAPE_H

#include "msgs/bag/record.h"
#include "msgs/bus_message.h"
#include "dsp/complaint.h"

struct tape_config {
    const char *bag;
    double start_s, end_s; /* after the bag's first message; end_s may be INFINITY */
    const char *remap; /* "FROM:=TO,...": channels called FROM are of topic TO; NULL */
};

struct tape_part { /* the messages of one node and topic */
    const struct topic *topic;
    char node[ENVELOPE_NODE_SIZE];
    bool wanted; /* all are at first */
};

struct tape_message {
    const struct tape_part *part;
    struct envelope envelope; /* as it went over the bus */
    struct bytes payload;     /* until the next one */
};

struct tape;

/* 0; errors of bag_catalog_open; -EINVAL (a remap that says nothing, or a time beyond the
 * bag's end), -ENODATA (no message of ours), -ENOMEM. */
int tape_open(struct tape **out, const struct tape_config *cfg, struct complaint *why);

/* The i-th part, or NULL. */
struct tape_part *tape_part(struct tape *t, size_t i);

/* Channels whose messages nobody here understands. */
size_t tape_foreign(const struct tape *t);

/* First and last publish stamp of what is played. */
int64_t tape_start_ns(const struct tape *t);
int64_t tape_end_ns(const struct tape *t);

/* The next message will be the first one at or after the time.  To be called before the
 * first tape_next, and after a part became wanted or unwanted. */
void tape_seek(struct tape *t, int64_t publish_ns);

/* 0, -ENODATA (the end), as bag_cursor_next. */
int tape_next(struct tape *t, struct tape_message *out, struct complaint *why);

/* The newest survey at or before the time, else the first one after it.  0, -ENODATA
 * (there is none), as bag_cursor_next. */
int tape_find_survey(struct tape *t, int64_t publish_ns, struct tape_message *out,
                     struct complaint *why);
void tape_close(struct tape *t);

#endif
