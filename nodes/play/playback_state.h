/* SPDX-License-Identifier: MIT */
/* nodes/play/playback_state.h -- the inside of a player, for its parts. */
#ifndef ANLOS_NODES_PLAY_PLAYBACK_STATE_H
#define ANLOS_NODES_PLAY_PLAYBACK_STATE_H

#include "msgs/playback_publisher.h"
#include "nodes/play/playback.h"
#include "nodes/play/subscribers.h"

#define UNDER_WAY_MAX 96
#define FRAMES_AHEAD  8 /* pings of an array that stands, each of which makes an image */

struct playback_next { /* the message that is to go next */
    bool is;
    struct bag_iterator_message m; /* payload as it goes out */
    bool flow;                     /* it is one that a receipt answers: */
    struct account_ping ping;
    uint64_t survey_id;             /* of a survey */
    Anlos__ScanStatus__State state; /* of a scan/status */
    uint32_t scan;
};

struct kept { /* for who comes late */
    struct bytes_buffer payload;
    int64_t publish_ns;
    int64_t sent_ns; /* last, by the machine's clock */
    char node[ENVELOPE_NODE_SIZE];
};

/* When a message of the bag is due by the machine's clock. */
struct tempo {
    double rate; /* of the recording's pace; 0: everything is due at once */
    bool started;
    int64_t bag_ns, machine_ns; /* a point of the line that both times are on */
};

struct playback {
    struct playback_config cfg;
    struct bag_iterator *bag_iterator;
    struct playback_publisher *playback_publisher;
    struct subscribers subscribers;
    struct account account;
    struct tempo tempo;
    const struct topic *flow; /* what is answered by receipts; NULL: nothing is */
    struct playback_next next;
    struct bytes_buffer rewritten;

    bool begun, hears, paused, ended, bag_iterator_ended;
    bool enters; /* another round, in which nothing goes out before all are in it */
    unsigned ones;
    int64_t begin_ns; /* not before; 0: it is not known yet */
    bool ready;       /* all are, and were told that it begins */
    int64_t at_ns;
    int64_t sign_ns; /* last receipt, or ping after all were answered */
    char waits_for[200];
    char note[300];
    bool noted;
    uint64_t messages, malformed, lists, rounds;

    /* What went out and is not used by all yet, the oldest first: [n_under_way]. */
    struct {
        int64_t publish_ns;
        bool flow;
    } under_way[UNDER_WAY_MAX];
    size_t n_under_way;
    bool crowded;            /* the next one has the stamp of all of them, and no room */
    uint64_t progress_round; /* begins with the epoch, counted on by each jump */
    int64_t told_ns;         /* in it: all up to here went out, as was said, */
    int64_t told_at_ns;      /* at this time of the machine's */
    int64_t used_ns, used_since_ns; /* how far all are; since when, by the machine */
    uint64_t stopped;               /* nodes that began anew or came no further */

    struct kept survey, status;
    uint64_t survey_id;
    size_t pings_of_scan;  /* by the survey */
    int64_t survey_new_ns; /* not 0: another one was sent then, and has to be taken */

    /* A scan that is played again, or was begun again, counts on. */
    uint32_t scan_base, newest_scan;
    int64_t scan_epoch_ns;
    uint32_t scan; /* of the newest ping */
    Anlos__Pass pass;
    uint32_t position;
    size_t scene_used;
    bool background;                 /* there was a pass of it */
    bool endless;                    /* the array stood: only a person ended it */
    uint32_t used_frame, list_frame; /* then: of the newest ping used, and list */
    uint64_t lists_then;             /* when one came last, */
    int64_t quiet_since_ns;          /* which was then; 0: not waited for */
    bool scan_ended;
    uint32_t list_scan;    /* of the newest list */
    int64_t list_since_ns; /* not 0: the list of this scan is waited for since then */

    bool says_status, has_status; /* stands in for it; the bag has it */
    int64_t status_due_ns;
};

/* playback_cast.c: who plays what to whom. */
int playback_cast(struct playback *p, struct error *why);

/* playback_next.c: the message that is to go next, and what is other when it went.
 * playback_load: 0, -ENODATA (the end), -EAGAIN (there was much that is none: ask again),
 * as bag_iterator_next. */
int playback_load(struct playback *p, struct error *why);
int playback_went(struct playback *p, const struct playback_next *n, int64_t now_ns);

/* playback_hold.c */
/* May the next message go?  Else waits_for has the reason. */
bool playback_may_go(struct playback *p, int64_t now_ns);

/* Are all in this round?  Else waits_for has who is not. */
bool playback_is_entered(struct playback *p, int64_t now_ns);

/* Is every ping answered, and the list there?  For the end and for another scan. */
bool playback_is_settled(struct playback *p, int64_t now_ns);

/* Have all lists come of an array that stood?  Whoever reports ends when it is said that
 * the recording did. */
bool playback_has_lists(struct playback *p, int64_t now_ns);

/* playback_say.c: what is said beyond the recording.  0 or errors of bus_publish. */
int playback_keep(struct kept *k, const char *node, struct bytes payload,
                  int64_t publish_ns, int64_t now_ns);
int playback_find_survey(struct playback *p, int64_t now_ns, struct error *why);
int playback_repeat(struct playback *p, int64_t period_ns, int64_t now_ns);
int playback_say_begin(struct playback *p, int64_t now_ns);
int playback_say_running(struct playback *p, int64_t now_ns);
int playback_say_end(struct playback *p, int64_t now_ns);
bool playback_is_hopeless(const struct playback *p);
int playback_say_hopeless(struct playback *p, int64_t now_ns);

/* The scan has ended: waits for its list if there will be one. */
void playback_end_scan(struct playback *p, int64_t now_ns);

void playback_notes(struct playback *p, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
