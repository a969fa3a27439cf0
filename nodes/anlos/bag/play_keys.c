#include "nodes/anlos/bag/play_keys.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "hal/clock.h"

#define SEEK_NS        10000000000LL
#define SHOW_PERIOD_NS 100000000LL
#define CLEAR_LINE     "\r\033[K"

enum { SLOWEST_DIVISOR = 64, FASTEST = 64 };

static void change_rate(struct playback *p, double rate, bool faster, int64_t now_ns)
{
    double wanted = faster ? 2.0 * rate : 0.5 * rate;

    if (rate <= 0.0) /* max */
        wanted = faster ? 0.0 : FASTEST;
    else if (wanted > FASTEST)
        wanted = 0.0;
    else if (wanted < 1.0 / SLOWEST_DIVISOR)
        wanted = 1.0 / SLOWEST_DIVISOR;
    playback_rate(p, wanted, now_ns);
}

static int take_key(struct playback *p, char key, int64_t now_ns)
{
    struct playback_status s;

    playback_status(p, &s);
    switch (key) {
    case ' ':
        playback_pause(p, s.phase != PLAYBACK_PAUSES, now_ns);
        return 0;
    case '.':
        if (s.phase != PLAYBACK_PAUSES)
            playback_pause(p, true, now_ns);
        playback_one(p);
        return 0;
    case '+':
    case '=':
    case '-':
        change_rate(p, s.rate, key != '-', now_ns);
        return 0;
    case 'q':
        return -ECANCELED;
    default:
        return 0;
    }
}

static void take_arrow(struct playback *p, char key)
{
    struct playback_status s;

    playback_status(p, &s);
    if (key == 'C') /* right */
        playback_seek(p, s.at_ns < s.end_ns - SEEK_NS ? s.at_ns + SEEK_NS : s.end_ns);
    else if (key == 'D') /* left */
        playback_seek(p, s.at_ns - SEEK_NS);
    else if (key == 'H') /* home */
        playback_seek(p, s.start_ns);
}

int play_keys_take(struct play_keys *k, struct playback *p, const char *bytes, size_t n,
                   int64_t now_ns)
{
    int err = 0;

    k->show_due_ns = 0;
    for (size_t i = 0; i < n && !err; i++) {
        if (bytes[i] != '\033')
            err = take_key(p, bytes[i], now_ns);
        else if (n - i >= 3 && (bytes[i + 1] == '[' || bytes[i + 1] == 'O'))
            take_arrow(p, bytes[i += 2]);
    }
    return err;
}

static int read_keys(void *ctx, struct playback *p, int64_t now_ns)
{
    char bytes[64];
    ssize_t n = read(STDIN_FILENO, bytes, sizeof bytes);

    if (n < 0)
        return errno == EINTR || errno == EAGAIN ? 0 : -errno;
    return n ? play_keys_take(ctx, p, bytes, (size_t)n, now_ns) : -ECANCELED;
}

void play_keys_line(const struct playback_status *s, char *text, size_t size)
{
    static const char *const phases[] = {[PLAYBACK_WAITS] = "waits",
                                         [PLAYBACK_PLAYS] = "plays",
                                         [PLAYBACK_PAUSES] = "pauses",
                                         [PLAYBACK_ENDED] = "has ended"};
    char rate[32] = "max", pings[96] = "";

    if (s->rate > 0.0)
        snprintf(rate, sizeof rate, "%gx", s->rate);
    if (s->pings.played)
        snprintf(pings, sizeof pings,
                 "  %" PRIu64 " pings, %" PRIu64 " used, %" PRIu64 " lost",
                 s->pings.played, s->pings.used, s->pings.unused + s->pings.missing);
    snprintf(text, size, "%7.1f of %.1f s  %s at %s%s  %s",
             1e-9 * (double)(s->at_ns - s->start_ns),
             1e-9 * (double)(s->end_ns - s->start_ns), phases[s->phase], rate, pings,
             s->text);
}

static void show(void *ctx, const struct playback_status *s)
{
    struct play_keys *k = ctx;
    int64_t now_ns = clock_now_ns(clock_system());
    char text[80]; /* a line of any terminal, so that it stays one */

    if (!k->terminal || (now_ns < k->show_due_ns && s->phase == k->status.phase))
        return;
    k->show_due_ns = now_ns + SHOW_PERIOD_NS;
    k->status = *s;
    play_keys_line(s, text, sizeof text);
    printf(CLEAR_LINE "%s", text);
    fflush(stdout);
    k->shown = true;
}

void play_keys_open(struct play_keys *k, struct play_control *out)
{
    *k = (struct play_keys){.terminal = isatty(STDIN_FILENO) && isatty(STDOUT_FILENO) &&
                                        !tcgetattr(STDIN_FILENO, &k->before)};
    *out = (struct play_control){.fd = -1, .read = read_keys, .show = show, .ctx = k};
    if (!k->terminal || tcgetattr(STDIN_FILENO, &k->before))
        return;
    struct termios raw = k->before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C still is one */
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    if (!tcsetattr(STDIN_FILENO, TCSANOW, &raw))
        out->fd = STDIN_FILENO;
}

void play_keys_close(struct play_keys *k)
{
    if (k->shown)
        printf("\n");
    if (k->terminal)
        tcsetattr(STDIN_FILENO, TCSANOW, &k->before);
}
