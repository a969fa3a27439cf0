#include "msgs/ear.h"

#include <errno.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <string.h>

#include "msgs/endpoint.h"

/* nanomsg drops the connection over this, without a word, and allocates what a header
 * asks for under it; what is over a topic's own bound is refused and counted (inlet). */
#define RECEIVE_MAX_BYTES    (1 << 30)
#define RECEIVE_BUFFER_BYTES (32 << 20)
#define RECONNECT_MS         20
#define RECONNECT_MAX_MS     200

static int set_options(struct ear *ear)
{
    const int max = RECEIVE_MAX_BYTES, buffer = RECEIVE_BUFFER_BYTES;
    const int first = RECONNECT_MS, last = RECONNECT_MAX_MS;
    size_t fd_size = sizeof ear->fd;
    int s = ear->socket;
    if (nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVMAXSIZE, &max, sizeof max) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVBUF, &buffer, sizeof buffer) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL, &first, sizeof first) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL_MAX, &last, sizeof last) < 0 ||
        nn_setsockopt(s, NN_SUB, NN_SUB_SUBSCRIBE, "", 0) < 0 ||
        nn_getsockopt(s, NN_SOL_SOCKET, NN_RCVFD, &ear->fd, &fd_size) < 0)
        return -errno;
    return 0;
}

/* Subscribes to everything on the endpoints, which carry this topic only: whatever else
 * comes out of them is refused and counted, not filtered away in silence. */
int ear_open(struct ear *ear, const struct topic *t, const char *run_dir)
{
    char url[ENDPOINT_URL_SIZE];
    const char *node;
    *ear = (struct ear){.topic = t};
    ear->socket = nn_socket(AF_SP, NN_SUB);
    if (ear->socket < 0)
        return -errno;
    int err = set_options(ear);
    for (size_t i = 0; !err && (node = topic_publisher(t, i)); i++) {
        err = i < EAR_MAX_PUBLISHERS ? endpoint_url(url, run_dir, node, t->name, NULL)
                                     : -E2BIG;
        if (!err && nn_connect(ear->socket, url) < 0)
            err = -errno;
    }
    if (err)
        ear_close(ear);
    return err;
}

struct ear_source *ear_find_source(struct ear *ear, const char *node)
{
    const char *name;
    for (size_t i = 0; i < EAR_MAX_PUBLISHERS && (name = topic_publisher(ear->topic, i));
         i++)
        if (strcmp(name, node) == 0)
            return &ear->sources[i];
    return NULL;
}

/* What was sent before the first message that arrives here is not missed, nor is what a
 * process sent that has been restarted since. */
static uint64_t count_gap(struct ear_source *s, const struct envelope *e)
{
    uint64_t gap = 0;
    if (s->known && s->epoch_ns == e->epoch_ns && e->sequence > s->next)
        gap = e->sequence - s->next;
    s->known = true;
    s->epoch_ns = e->epoch_ns;
    s->next = e->sequence + 1;
    return gap;
}

void ear_count(struct ear *ear, struct ear_source *source, const struct envelope *e)
{
    ear->messages++;
    ear->bytes += e->payload_size;
    ear->gaps += count_gap(source, e);
}

void ear_close(struct ear *ear)
{
    while (nn_close(ear->socket) < 0 && errno == EINTR)
        ;
}
