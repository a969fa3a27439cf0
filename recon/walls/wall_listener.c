/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_listener.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/mount.h"

#define PAIRS_MOST 2048 /* of a scan: more places are ignored */
#define GROUND_M   0.05 /* a mount lower than this does not say where the ground is */

struct heard {     /* a ping's echoes, as it stood */
    int64_t at_ns; /* the middle of its emission */
    size_t first, n;
};

struct wall_listener {
    struct wall_listener_config cfg;
    const struct survey *survey;
    uint64_t survey_id;
    double lag_s[2]; /* wall_echo_lag_s of chirps up, down */
    struct wall_estimate_config estimate;
    size_t stride; /* of positions */

    bool looking;
    int64_t look_ns; /* when the newest look began */
    uint32_t scan;
    enum pass pass;
    size_t position, n_here; /* pings of this position in the look */
    size_t n_pings, n_echoes, n_pairs, room_pings, room_echoes;
    struct heard *pings;
    struct wall_echo *echoes, *moved; /* [room_echoes] */
    size_t unusable;
};

static void configure_estimate(struct wall_listener *l)
{
    struct wall_estimate_config *e = &l->estimate;
    double r[3][3], t[3];
    wall_estimate_default(e);
    e->prior.vertical = l->cfg.vertical;
    e->prior.vertical_rad = l->cfg.vertical_rad;
    e->reach_m[1] = l->cfg.reach_m;
    mount_survey_axes(l->survey, r, t);
    if (!l->survey->has_mount || t[2] < GROUND_M)
        return;
    e->has_ground = true; /* z = 0 of the vehicle */
    e->ground =
        (struct wall){.normal = {-r[2][0], -r[2][1], -r[2][2]}, .distance_m = t[2]};
}

static int allocate(struct wall_listener *l)
{
    const struct survey *s = l->survey;
    size_t pairs = s->n_speakers * s->n_microphones;
    size_t positions = s->n_positions;
    size_t whole = (pairs * positions + PAIRS_MOST - 1) / PAIRS_MOST;
    l->stride = whole < positions ? whole : positions - (positions > 1);
    positions = (positions + l->stride - 1) / l->stride;
    l->room_pings = positions * s->n_speakers;
    l->room_echoes = positions * pairs * WALL_PEAKS;
    l->pings = calloc(l->room_pings, sizeof *l->pings);
    l->echoes = calloc(l->room_echoes, sizeof *l->echoes);
    l->moved = calloc(l->room_echoes, sizeof *l->moved);
    return l->pings && l->echoes && l->moved ? 0 : -ENOMEM;
}

/* 0 of a replica that is no chirp. */
static void know_lags(struct wall_listener *l)
{
    struct survey turned = *l->survey; /* borrows */
    for (int down = 0; down < 2 && !turned.n_replica; down++) {
        turned.chirp_start_hz = down ? l->survey->chirp_stop_hz
                                     : l->survey->chirp_start_hz;
        turned.chirp_stop_hz = down ? l->survey->chirp_start_hz
                                    : l->survey->chirp_stop_hz;
        const struct chirp chirp = processing_chirp(&turned);
        l->lag_s[down] = wall_echo_lag_s(&chirp);
    }
}

int wall_listener_create(struct wall_listener **out,
                         const struct wall_listener_config *cfg, const struct survey *s,
                         struct error *why)
{
    if (s->pings_m)
        return error_say(why, -EINVAL,
                         "walls: pings with places of their own tell none; name them in "
                         "the survey");
    double until_s;
    bool alone;
    int err = wall_receiver_reach(s, cfg->reach_m, &until_s, &alone, why);
    if (err)
        return err;
    struct wall_listener *l = calloc(1, sizeof *l);
    if (!l)
        return error_say(why, -ENOMEM, "not enough memory to look for walls");
    l->cfg = *cfg;
    l->survey = s;
    l->survey_id = survey_id(s);
    configure_estimate(l);
    know_lags(l);
    err = allocate(l);
    if (err) {
        wall_listener_destroy(l);
        return error_say(why, err, "not enough memory to look for walls");
    }
    *out = l;
    return 0;
}

void wall_listener_destroy(struct wall_listener *l)
{
    if (!l)
        return;
    free(l->pings);
    free(l->echoes);
    free(l->moved);
    free(l);
}

size_t wall_listener_unusable(const struct wall_listener *l)
{
    return l->unusable;
}

static void forget(struct wall_listener *l)
{
    l->n_pings = l->n_echoes = l->n_pairs = l->n_here = 0;
}

/* The echoes of one microphone; a silent one does not count as a pair. */
static void add(struct wall_listener *l, const struct ping *ping, size_t microphone,
                const struct wall_arrivals *arrived)
{
    struct wall_echo e = {.pair = (uint32_t)l->n_pairs,
                          .speaker = ping->speaker,
                          .microphone = (uint32_t)microphone,
                          .place = ping->position,
                          .lag_s = l->lag_s[ping->down ? 1 : 0]};
    struct geometry g;
    processing_geometry(&g, l->survey);
    geometry_speaker(&g, ping->position, ping->speaker, e.speaker_m);
    geometry_microphone(&g, ping->position, ping->speaker, microphone, e.microphone_m);
    double loudest = 0.0;
    for (size_t k = 0; k < arrived->n; k++)
        loudest = fmax(loudest, arrived->peaks[k].amplitude);
    l->n_pairs++;
    for (size_t k = 0; k < arrived->n && l->n_echoes < l->room_echoes; k++) {
        e.path_m = arrived->peaks[k].path_m;
        e.weight = arrived->peaks[k].amplitude / loudest;
        l->echoes[l->n_echoes++] = e;
    }
}

static void hear(struct wall_listener *l, const struct wall_returns *returns)
{
    const struct survey *s = l->survey;
    double middle_s = s->latency_samples / s->sample_rate_hz + 0.5 * s->chirp_duration_s;
    struct heard *h = &l->pings[l->n_pings++];
    *h = (struct heard){.at_ns = returns->ping.capture_ns + (int64_t)(1e9 * middle_s),
                        .first = l->n_echoes};
    for (size_t m = 0; m < s->n_microphones; m++)
        if (returns->at[m].heard)
            add(l, &returns->ping, m, &returns->at[m]);
    h->n = l->n_echoes - h->first;
}

/* What came over the bus may be of another array. */
static bool is_usable(const struct wall_listener *l, const struct wall_returns *returns)
{
    const struct survey *s = l->survey;
    return returns->usable && returns->ping.survey_id == l->survey_id &&
           returns->n_microphones == s->n_microphones &&
           returns->ping.position < s->n_positions &&
           returns->ping.speaker < s->n_speakers;
}

/* An echo of an array that stood at r p + t and moved at v there. */
static void carry(const struct wall_echo *from, const double r[3][3], const double t[3],
                  const double v[3], double sound_speed_m_s, struct wall_echo *to)
{
    double flight_s = from->path_m / sound_speed_m_s;
    *to = *from;
    for (int a = 0; a < 3; a++) {
        to->velocity_m_s[a] = r[a][0] * v[0] + r[a][1] * v[1] + r[a][2] * v[2];
        to->speaker_m[a] = t[a];
        to->microphone_m[a] = t[a] + flight_s * to->velocity_m_s[a];
        for (int b = 0; b < 3; b++) {
            to->speaker_m[a] += r[a][b] * from->speaker_m[b];
            to->microphone_m[a] += r[a][b] * from->microphone_m[b];
        }
    }
}

/* The array of each ping stood somewhere else in the frame of now; false: unknown where.
 */
static bool carry_all(struct wall_listener *l, const struct ego_path *path,
                      int64_t now_ns)
{
    bool known = true;
    struct mount mount;
    mount_of_survey(l->survey, &mount);
    for (size_t k = 0; k < l->n_pings; k++) {
        const struct heard *h = &l->pings[k];
        struct ego_step step = {0.0, 0.0, 0.0};
        struct ego_motion motion = {0.0, 0.0};
        double r[3][3], t[3], v[3];
        known = (!path || (!ego_path_between(path, h->at_ns, now_ns, &step) &&
                           !ego_path_at(path, h->at_ns, &motion))) &&
                known;
        mount_step(&mount, &step, r, t);
        mount_velocity(&mount, &motion, v);
        for (size_t i = h->first; i < h->first + h->n; i++)
            carry(&l->echoes[i], (const double(*)[3])r, t, v, l->survey->sound_speed_m_s,
                  &l->moved[i]);
    }
    return known;
}

static bool conclude(struct wall_listener *l, const struct ego_path *path,
                     int64_t capture_ns, struct wall_estimates *out, bool *blind)
{
    *blind = !carry_all(l, path, capture_ns);
    return !*blind &&
           !wall_estimate(out, &l->estimate, l->moved, l->n_echoes, l->n_pairs);
}

/* Does this ping begin a look?  A scan's look goes on from position to position. */
static void begin(struct wall_listener *l, const struct ping *ping)
{
    int64_t capture_ns = ping->capture_ns;
    bool is_scan = l->survey->n_positions > 1;
    bool anew = is_scan ? ping->scan != l->scan || ping->pass != l->pass : !l->looking;
    bool due = capture_ns - l->look_ns >= (int64_t)(1e9 * l->cfg.every_s) ||
               capture_ns < l->look_ns;
    if (anew && (is_scan || due)) {
        forget(l);
        l->looking = true;
        l->scan = ping->scan;
        l->pass = ping->pass;
        l->position = ping->position;
        l->look_ns = is_scan ? l->look_ns : capture_ns;
    }
    if (is_scan && ping->position != l->position) {
        l->position = ping->position;
        l->n_here = 0;
    }
}

bool wall_listener_take(struct wall_listener *l, const struct wall_returns *returns,
                        const struct ego_path *path, struct wall_estimates *out,
                        bool *blind)
{
    const struct ping *ping = &returns->ping;
    int64_t capture_ns = ping->capture_ns;
    bool is_scan = l->survey->n_positions > 1;
    begin(l, ping);
    if (!l->looking || ping->position % l->stride || l->n_pings == l->room_pings)
        return false;
    if (is_usable(l, returns))
        hear(l, returns);
    else
        l->unusable++;
    if (++l->n_here < l->survey->n_speakers)
        return false;
    l->n_here = 0;
    l->looking = is_scan;
    bool due = capture_ns - l->look_ns >= (int64_t)(1e9 * l->cfg.every_s) ||
               capture_ns < l->look_ns || l->n_pings == l->room_pings;
    if (is_scan && !due)
        return false;
    l->look_ns = is_scan ? capture_ns : l->look_ns;
    return conclude(l, path, capture_ns, out, blind) || *blind;
}
