/* SPDX-License-Identifier: MIT */
#include "nodes/can/sender.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/can/watch.h"

/* In the frame it is rounded; 1 would say that in one direction nothing is off at all. */
#define MOST_CORRELATION 0.96

struct worth {
    double existence; /* in tenths; -1: it is no probability, and less than any */
    double distance_m;
};

/* The vehicle's origin is as good as its nearest edge: objects are metres away. */
static struct worth worth_of(double existence, const double p[3])
{
    double d = sqrt(p[0] * p[0] + p[1] * p[1]);
    bool known = existence >= 0.0 && existence <= 1.0;

    return (struct worth){known ? round(10.0 * existence) : -1.0,
                          isnan(d) ? INFINITY : d};
}

static struct worth worth_of_detection(const Anlos__Detection *d)
{
    const double nowhere[3] = {NAN, NAN, NAN};
    const double p[3] = {d->position_m ? d->position_m->x : 0,
                         d->position_m ? d->position_m->y : 0, 0};

    return worth_of(d->existence, d->position_m ? p : nowhere);
}

static bool is_less(struct worth a, struct worth b)
{
    if (a.existence < b.existence || b.existence < a.existence)
        return a.existence < b.existence;
    return a.distance_m > b.distance_m;
}

/* Of those that are picked, the one of the least worth goes; of equal ones the last. */
static void drop_least(struct worth *worths, size_t *picked, size_t n)
{
    size_t least = 0;

    for (size_t i = 1; i < n; i++)
        if (!is_less(worths[least], worths[i]))
            least = i;
    for (size_t i = least; i + 1 < n; i++) {
        worths[i] = worths[i + 1];
        picked[i] = picked[i + 1];
    }
}

struct pick {
    size_t max, n;
    struct worth worths[CAN_MAX_OBJECTS + 1];
    size_t picked[CAN_MAX_OBJECTS + 1];
};

static void add(struct pick *p, size_t index, struct worth worth)
{
    p->worths[p->n] = worth;
    p->picked[p->n++] = index;
    if (p->n > p->max)
        drop_least(p->worths, p->picked, p->n--);
}

static size_t give(const struct pick *p, size_t *picked)
{
    for (size_t i = 0; i < p->n; i++)
        picked[i] = p->picked[i];
    return p->n;
}

size_t pick_detections(const Anlos__DetectionList *list, size_t max, size_t *picked)
{
    struct pick p = {.max = max};

    for (size_t i = 0; i < list->n_detections; i++)
        add(&p, i, worth_of_detection(list->detections[i]));
    return give(&p, picked);
}

size_t pick_objects(const struct can_object *objects, size_t n, size_t max,
                    size_t *picked)
{
    struct pick p = {.max = max};

    for (size_t i = 0; i < n; i++)
        add(&p, i, worth_of(objects[i].existence, objects[i].position_m));
    return give(&p, picked);
}

#define WINDOW_NS    1000000000ULL
#define SPARE        2.0 /* lists: one more than a second has counts; all come unevenly */
#define LEAST_SPAN_S 0.25 /* some lists at once are no pace */

/* Modulo 2^64 ns: a stamp is whatever its sender wrote. */
static uint64_t age_ns(const struct bus_budget *a, size_t number, int64_t now_ns)
{
    return (uint64_t)now_ns - (uint64_t)a->lists[number % BUS_BUDGET_LISTS].begun_ns;
}

/* The first list that began within the last second; a->n: none did. */
static size_t first_within(const struct bus_budget *a, int64_t now_ns)
{
    size_t first = a->n;

    while (first && a->n - first < BUS_BUDGET_LISTS &&
           age_ns(a, first - 1, now_ns) < WINDOW_NS)
        first--;
    return first;
}

static double taken_s(const struct bus_budget *a, size_t first)
{
    double sum = 0.0;

    for (size_t i = first ? first - 1 : 0; i < a->n; i++)
        if (a->n - i <= BUS_BUDGET_LISTS)
            sum += a->lists[i % BUS_BUDGET_LISTS].bus_s;
    return sum;
}

/* What the next list may take of the bus.  What is left is for those, too, that are still
 * to come in the second that the first of them began. */
static double share_s(const struct bus_budget *a, int64_t now_ns, double lists_s)
{
    size_t first = first_within(a, now_ns);
    double span_s = first < a->n ? 1e-9 * (double)age_ns(a, first, now_ns) : 0.0;
    double pace_hz = fmax(1.0, (double)(a->n - first) / fmax(span_s, LEAST_SPAN_S));
    double left_s = lists_s - taken_s(a, first);

    if (a->n - first == BUS_BUDGET_LISTS)
        return 0.0;
    return fmin(lists_s / (pace_hz + SPARE),
                left_s / fmax(1.0, pace_hz * (1.0 - span_s)));
}

size_t bus_budget_objects(struct bus_budget *a, const struct bus_budget_config *cfg,
                          int64_t now_ns, size_t n_view)
{
    double lists_s = cfg->load - can_cycles_s(&cfg->rate);
    double empty_s = can_list_s(&cfg->rate, 0, cfg->fd, cfg->motion);
    double object_s = can_list_s(&cfg->rate, 1, cfg->fd, cfg->motion) - empty_s;

    if (a->n && now_ns < a->lists[(a->n - 1) % BUS_BUDGET_LISTS].begun_ns)
        a->n = 0;
    double taken_s = empty_s + can_view_s(&cfg->rate, n_view);
    double n = floor((share_s(a, now_ns, lists_s) - taken_s) / object_s);
    return n > 0.0 ? (size_t)fmin(n, CAN_MAX_OBJECTS) : 0;
}

void bus_budget_begin(struct bus_budget *a, const struct bus_budget_config *cfg,
                      int64_t now_ns, size_t n_objects, size_t n_view)
{
    a->lists[a->n % BUS_BUDGET_LISTS].begun_ns = now_ns;
    a->lists[a->n % BUS_BUDGET_LISTS].bus_s =
        can_list_s(&cfg->rate, n_objects, cfg->fd, cfg->motion) +
        can_view_s(&cfg->rate, n_view);
    a->n++;
}

#define BEYOND_M     0.3  /* a middle is farther than what is heard of it, at most */
#define COUNTER_HALF 2048 /* of what a frame holds: a larger step looks like one back */

void sender_config_set(struct sender_config *out, const struct launchfile *l)
{
    *out = (struct sender_config){
        .base_id = CAN_BASE_DEFAULT,
        .bus = {.rate = {.nominal_bit_s = 500e3, .data_bit_s = 2e6}, .load = 0.5},
    };
    if (!l)
        return;
    out->base_id = l->can.base_id + CAN_SENSOR_STEP * l->can.sensor;
    out->bus = (struct bus_budget_config){
        .rate = {.nominal_bit_s = l->can.bitrate, .data_bit_s = l->can.data_bitrate},
        .fd = l->can.fd,
        .motion = l->can.motion,
        .view = l->can.field_of_view,
        .load = l->can.load};
    out->stale_ns = l->scan.fixed ? WATCH_STALE_NS : 0;
}

void sender_init(struct sender *s, const struct sender_config *cfg)
{
    *s = (struct sender){
        .cfg = *cfg,
        .status = {.source = CAN_SOURCE_UNKNOWN,
                   .temperature_c = NAN,
                   .sound_speed_m_s = NAN,
                   .range_m = NAN},
        .diagnosis = {.cpu = NAN, .snr_db = NAN},
        .protection = {.base = cfg->base_id},
        .lets_objects = true,
        .counter = UINT32_MAX,
        .message_counter = UINT32_MAX,
        .time_sync = CAN_SYNC_UNKNOWN,
    };
}

void sender_let_objects(struct sender *s, bool lets)
{
    s->lets_objects = lets;
    if (!lets)
        memset(s->told, 0, sizeof s->told);
}

static enum can_source source_of(Anlos__Source source)
{
    switch (source) {
    case ANLOS__SOURCE__LIVE:
        return CAN_LIVE;
    case ANLOS__SOURCE__REPLAY:
        return CAN_REPLAY;
    default: /* what is not known to be live must not look live */
        return CAN_SIMULATION;
    }
}

void sender_survey(struct sender *s, const Anlos__Survey *survey)
{
    s->status.source = source_of((Anlos__Source)survey->source);
    s->status.temperature_c = survey->temperature_c;
    s->status.sound_speed_m_s = survey->sound_speed_m_s;
    s->has_array = survey->has_mount && survey->mount_origin_m;
    if (!s->has_array)
        return;
    s->array_m[0] = survey->mount_origin_m->x;
    s->array_m[1] = survey->mount_origin_m->y;
    s->array_m[2] = survey->mount_origin_m->z;
}

/* A variance that is none says nothing: it must not look like certainty. */
static double sigma_of(double variance)
{
    return variance >= 0.0 ? sqrt(variance) : NAN;
}

static double larger(double a, double b)
{
    return isnan(a) || isnan(b) ? NAN : fmax(a, b);
}

/* Of two errors; never so near to 1 that the frame would say 1.  What is of no covariance
 * stays so: fit() counts it. */
static double correlation_of(double covariance, double sigma, double other_sigma)
{
    double product = sigma * other_sigma;
    double r = product <= 0.0 ? 0.0 : covariance / product;

    return fabs(r) <= 1.0 ? copysign(fmin(fabs(r), MOST_CORRELATION), r) : r;
}

/* Where it is, as far as that is known in the vehicle: the mirror image of an object, or
 * a place in the array's own frame, would be an obstacle where there is none. */
static void fill_place(struct can_object *o, const Anlos__Detection *d)
{
    if (d->position_m) {
        o->position_m[0] = d->position_m->x;
        o->position_m[1] = d->position_m->y;
        o->position_m[2] = d->position_m->z;
    }
    if (d->n_covariance_m2 == 6) {
        const double *c = d->covariance_m2; /* xx xy xz yy yz zz */
        memcpy(o->covariance_m2, c, sizeof o->covariance_m2);
        o->sigma_m[0] = sigma_of(c[0]);
        o->sigma_m[1] = sigma_of(c[3]);
        o->correlation = correlation_of(c[1], o->sigma_m[0], o->sigma_m[1]);
    }
    if (d->extent_m) { /* in the position's frame */
        o->length_m = d->extent_m->x;
        o->width_m = d->extent_m->y;
        o->height_m = d->extent_m->z;
    }
}

#define COURSE_SIGMAS 2.0 /* here one of 44 goes the other way */

/* covariance: xx xy yy.  The error of a direction is that of the velocity across it, seen
 * from where the velocity begins; at this limit the error along it counts, too.  One
 * standard deviation then holds the 68 % that it should, or up to 74. */
static void fill_course(struct can_object *o, const double covariance[3])
{
    const double *v = o->velocity_m_s, *c = covariance;
    double speed = hypot(v[0], v[1]);
    double worst = 0.5 * (c[0] + c[2]) + hypot(0.5 * (c[0] - c[2]), c[1]);
    double across = (c[0] * v[1] * v[1] - 2.0 * c[1] * v[0] * v[1] + c[2] * v[0] * v[0]) /
                    (speed * speed);
    double along = c[0] + c[2] - across;

    if (o->motion != CAN_MOVING ||
        !(speed > 0.0 && across >= 0.0 && speed >= COURSE_SIGMAS * sqrt(worst)))
        return;
    o->course_rad = atan2(v[1], v[0]);
    o->sigma_course_rad = sqrt(across / (speed * speed - along));
}

static void fill_velocity(struct can_object *o, const Anlos__Detection *d)
{
    const double *c = d->velocity_covariance_m2_s2; /* xx xy yy */

    if (d->n_velocity_m_s == 2) {
        o->velocity_m_s[0] = d->velocity_m_s[0];
        o->velocity_m_s[1] = d->velocity_m_s[1];
    }
    if (d->n_velocity_covariance_m2_s2 != 3)
        return;
    o->sigma_velocity_m_s[0] = sigma_of(c[0]);
    o->sigma_velocity_m_s[1] = sigma_of(c[2]);
    o->sigma_v_m_s = larger(o->sigma_velocity_m_s[0], o->sigma_velocity_m_s[1]);
    o->velocity_correlation =
        correlation_of(c[1], o->sigma_velocity_m_s[0], o->sigma_velocity_m_s[1]);
    fill_course(o, c);
}

/* What comes next of an id that was there before is not new; without tracks lists do not
 * know each other. */
static enum can_measurement measurement_of(const Anlos__DetectionList *list,
                                           const Anlos__Detection *d)
{
    if (!list->tracked)
        return CAN_NEW;
    switch (d->measurement) {
    case ANLOS__MEASUREMENT__NEW:
        return CAN_NEW;
    case ANLOS__MEASUREMENT__MEASURED:
        return CAN_MEASURED;
    case ANLOS__MEASUREMENT__DELETED:
        return CAN_DELETED;
    default: /* what is not known to have been measured must not look so */
        return CAN_PREDICTED;
    }
}

/* All that is on the array's side of a wall is nearer to it than to its mirror image. */
static bool is_beyond(const struct sender *s, const Anlos__Detection *d)
{
    const Anlos__Vec3 *p = d->position_m, *v = d->virtual_m, *e = d->extent_m;

    if (!s->has_array || !d->wall || !p || !v)
        return false;
    double away_m =
        hypot(hypot(p->x - s->array_m[0], p->y - s->array_m[1]), p->z - s->array_m[2]);
    double image_m = hypot(hypot(v->x, v->y), v->z);
    double half_m = e ? 0.5 * hypot(hypot(e->x, e->y), e->z) : 0.0;
    return away_m > image_m + half_m + BEYOND_M;
}

static const struct can_object unknown = {
    .position_m = {NAN, NAN, NAN},
    .existence = NAN,
    .velocity_m_s = {NAN, NAN},
    .sigma_m = {NAN, NAN},
    .correlation = NAN,
    .length_m = NAN,
    .width_m = NAN,
    .sigma_v_m_s = NAN,
    .course_rad = NAN,
    .sigma_course_rad = NAN,
    .sigma_velocity_m_s = {NAN, NAN},
    .velocity_correlation = NAN,
    .covariance_m2 = {NAN, NAN, NAN, NAN, NAN, NAN},
    .height_m = NAN,
    .class_probability = NAN,
    .age_s = NAN,
    .unseen_s = NAN,
};

/* What its frame carries. */
static void forget_motion(struct can_object *o)
{
    memcpy(o->sigma_velocity_m_s, unknown.sigma_velocity_m_s,
           sizeof o->sigma_velocity_m_s);
    o->velocity_correlation = o->course_rad = o->sigma_course_rad = NAN;
}

static void forget_velocity(struct can_object *o)
{
    memcpy(o->velocity_m_s, unknown.velocity_m_s, sizeof o->velocity_m_s);
    o->sigma_v_m_s = NAN;
    forget_motion(o);
}

static void forget_covariance(struct can_object *o)
{
    memcpy(o->covariance_m2, unknown.covariance_m2, sizeof o->covariance_m2);
}

static void forget_place(struct can_object *o)
{
    memcpy(o->position_m, unknown.position_m, sizeof o->position_m);
    memcpy(o->sigma_m, unknown.sigma_m, sizeof o->sigma_m);
    o->correlation = o->length_m = o->width_m = o->height_m = NAN;
    forget_covariance(o);
    forget_velocity(o);
}

/* Do numbers[n], a member of o? */
static bool fit(const struct sender *s, const struct can_object *o, const double *numbers,
                size_t n)
{
    size_t offset = (size_t)((const char *)numbers - (const char *)o);
    bool fit = true;

    for (size_t i = 0; i < n; i++)
        fit &= can_object_fits(o, s->cfg.bus.fd, offset + i * sizeof *numbers);
    return fit;
}

static bool forget_outside(double *x, double min, double max)
{
    bool outside = *x < min || *x > max;

    if (outside)
        *x = NAN;
    return outside;
}

/* The end of a range in its stead would be a place, a speed or a certainty that nobody
 * measured.  Was there any? */
static bool forget_out_of_range(const struct sender *s, struct can_object *o)
{
    double *const amounts[] = {&o->length_m, &o->width_m, &o->height_m, &o->age_s,
                               &o->unseen_s};
    bool place = fit(s, o, o->position_m, 3), velocity = fit(s, o, o->velocity_m_s, 2),
         covariance = fit(s, o, o->covariance_m2, 6),
         correlation = fit(s, o, &o->correlation, 1),
         certainty = !s->cfg.bus.motion || fit(s, o, &o->velocity_correlation, 1);
    bool any = !place || !velocity || !covariance || !correlation || !certainty;

    if (!place)
        forget_place(o);
    if (!velocity)
        forget_velocity(o);
    if (!covariance)
        forget_covariance(o);
    if (!correlation)
        o->correlation = NAN;
    if (!certainty)
        forget_motion(o);
    any |= forget_outside(&o->existence, 0.0, 1.0);
    any |= forget_outside(&o->class_probability, 0.0, 1.0);
    for (size_t i = 0; i < sizeof amounts / sizeof *amounts; i++)
        any |= forget_outside(amounts[i], 0.0, INFINITY);
    return any;
}

/* Only tracks have ids that matter; of more objects than there are ids they are numbered
 * here. */
static void fill_object(struct sender *s, struct sender_list *out,
                        const Anlos__DetectionList *list, size_t i, size_t picked)
{
    const Anlos__Detection *d = list->detections[picked];
    size_t id = list->tracked || list->n_detections <= UINT8_MAX ? d->id : i + 1;
    struct can_object *o = &out->objects[i];

    *o = unknown;
    o->id = (uint8_t)id;
    o->counter = out->header.counter;
    o->measurement = measurement_of(list, d);
    o->existence = d->existence;
    o->class = d->multipath ? CAN_MULTIPATH : (enum can_class)d->shape;
    o->motion = (enum can_motion)d->motion;
    o->wall = (uint8_t)(d->wall < 255 ? d->wall : 255);
    o->behind_no_wall = d->behind_no_wall;
    o->in_free_view = d->in_free_view;
    if (d->shape && !d->multipath)
        o->class_probability = d->shape_probability;
    if (list->tracked) {
        o->age_s = d->age_s;
        o->unseen_s = d->unseen_s;
    }
    bool known = list->mirrored && list->in_vehicle_frame;
    if (known) {
        fill_place(o, d);
        fill_velocity(o, d);
    }
    if (forget_out_of_range(s, o)) {
        s->out_of_range++;
        out->note = "an object with a number that is out of the range of its signal, "
                    "which was not sent";
    }
    if (known && !isnan(o->position_m[0]) && is_beyond(s, d)) {
        s->beyond++;
        forget_place(o);
        out->note = "an object beyond the wall that mirrors it: its place was not sent";
    }
}

#define VIEW_MOST_M 163.8 /* of the frame's X and Y */

static bool is_sent_whole(const Anlos__ViewArea *a)
{
    bool fits = a->n_corners_m % 2 == 0 && a->n_corners_m >= 6 &&
                a->n_corners_m <= 2 * CAN_VIEW_CORNERS;

    for (size_t i = 0; i < a->n_corners_m; i++)
        fits &= fabs(a->corners_m[i]) <= VIEW_MOST_M; /* nor is NaN */
    return fits;
}

/* Where no object has a place, none can be told to be absent from one. */
static void fill_view(struct sender_list *out, const Anlos__DetectionList *list)
{
    uint8_t area = 0;

    out->n_view = 0;
    for (size_t k = 0; k < list->n_views && list->mirrored && list->in_vehicle_frame;
         k++) {
        const Anlos__ViewArea *a = list->views[k];
        size_t n = a->n_corners_m / 2;
        if (area == CAN_VIEW_AREAS || !is_sent_whole(a) ||
            out->n_view + n > SENDER_MAX_VIEW)
            continue;
        for (size_t i = 0; i < n; i++)
            out->view[out->n_view++] = (struct can_view_corner){
                .counter = out->header.counter,
                .wall = (uint8_t)(a->wall < 15 ? a->wall : 15),
                .area = area,
                .corner = (uint8_t)i,
                .corners = (uint8_t)n,
                .at_m = {a->corners_m[2 * i], a->corners_m[2 * i + 1]}};
        area++;
    }
}

static uint16_t next_counter(struct sender *s, const Anlos__DetectionList *list)
{
    uint32_t step = list->counter - s->message_counter;

    s->message_counter = list->counter;
    s->counter += step && step < COUNTER_HALF ? step : 1;
    return (uint16_t)s->counter;
}

void sender_list(struct sender *s, const Anlos__DetectionList *list, int64_t capture_ns,
                 struct sender_list *out)
{
    size_t picked[CAN_MAX_OBJECTS];
    uint16_t counter = next_counter(s, list);

    out->n_objects = pick_detections(list, CAN_MAX_OBJECTS, picked);
    out->header = (struct can_list_header){
        .counter = counter, .truncated = out->n_objects < list->n_detections};
    out->capture_ns = capture_ns;
    out->tracked = list->tracked;
    out->note = NULL;
    memset(out->lives, 0, sizeof out->lives);
    for (size_t i = 0; i < list->n_detections; i++)
        out->lives[(uint8_t)list->detections[i]->id] =
            measurement_of(list, list->detections[i]) != CAN_DELETED;
    out->dated_ns = 0;
    out->n_frames = 0;
    for (size_t i = 0; i < out->n_objects; i++)
        fill_object(s, out, list, i, picked[i]);
    fill_view(out, list);
}

void sender_empty_list(struct sender *s, int64_t capture_ns, struct sender_list *out)
{
    out->header = (struct can_list_header){.counter = (uint16_t)++s->counter};
    out->capture_ns = capture_ns;
    out->tracked = true;
    out->note = NULL;
    memset(out->lives, 0, sizeof out->lives);
    out->dated_ns = 0;
    out->n_objects = 0;
    out->n_view = 0;
    out->n_frames = 0;
}

/* In ms, modulo 2^64 ns: a stamp is whatever its sender wrote. */
static double age_ms(int64_t now_ns, int64_t then_ns)
{
    return 1e-6 * (double)(int64_t)((uint64_t)now_ns - (uint64_t)then_ns);
}

/* Of sound of the future it is not known; a millisecond is how exactly clocks agree. */
static double latency_ms(int64_t now_ns, int64_t capture_ns)
{
    double age = age_ms(now_ns, capture_ns);

    return age < -1.0 ? NAN : age;
}

static void pack_object(const struct sender *s, struct sender_list *list,
                        const struct can_object *o)
{
    struct can_frame_data *frame = list->frames + list->n_frames;

    if (s->cfg.bus.motion) {
        can_pack_object_motion(frame++, s->cfg.base_id, o);
        list->n_frames++;
    }
    if (s->cfg.bus.fd) {
        can_pack_object_fd(frame, s->cfg.base_id, o);
        list->n_frames++;
        return;
    }
    can_pack_object_state(frame, s->cfg.base_id, o);
    can_pack_object_dynamics(frame + 1, s->cfg.base_id, o);
    can_pack_object_quality(frame + 2, s->cfg.base_id, o);
    list->n_frames += 3;
}

/* Before Time, with which a list without objects is whole.  A sensor that may not tell of
 * objects sees nothing. */
static void pack_view(const struct sender *s, struct sender_list *list)
{
    const struct can_view_corner nothing = {.counter = list->header.counter,
                                            .at_m = {NAN, NAN}};
    struct can_frame_data *frame = list->frames + list->n_frames;

    if (!s->cfg.bus.view)
        return;
    list->claims = s->lets_objects && list->n_view;
    for (size_t i = 0; list->claims && i < list->n_view; i++)
        can_pack_field_of_view(frame++, s->cfg.base_id, &list->view[i]);
    if (!list->claims)
        can_pack_field_of_view(frame++, s->cfg.base_id, &nothing);
    list->n_frames = (size_t)(frame - list->frames);
}

/* As many frames as pack_view makes, at most. */
static size_t n_view_frames(const struct sender *s, const struct sender_list *list)
{
    return !s->cfg.bus.view ? 0 : list->n_view ? list->n_view : 1;
}

/* As the vehicle is told it now. */
static enum can_measurement told_measurement(const struct sender *s,
                                             const struct sender_list *list,
                                             const struct can_object *o)
{
    if (list->stale && o->measurement != CAN_DELETED)
        return CAN_PREDICTED;
    return o->measurement == CAN_MEASURED && !s->told[o->id] ? CAN_NEW : o->measurement;
}

/* Writes the indices of the objects that may be sent; returns how many. */
static size_t find_allowed(const struct sender *s, const struct sender_list *list,
                           size_t allowed[CAN_MAX_OBJECTS])
{
    size_t n = 0;

    for (size_t i = 0; s->lets_objects && i < list->n_objects; i++) {
        const struct can_object *o = &list->objects[i];
        if (!list->tracked || s->told[o->id] || told_measurement(s, list, o) == CAN_NEW)
            allowed[n++] = i;
    }
    return n;
}

/* Those of them that fit; returns whether all do. */
static bool sender_pick(struct sender *s, struct sender_list *list, int64_t now_ns)
{
    struct can_object objects[CAN_MAX_OBJECTS];
    size_t allowed[CAN_MAX_OBJECTS], n = find_allowed(s, list, allowed);
    size_t n_view = n_view_frames(s, list);
    size_t room = bus_budget_objects(&s->budget, &s->cfg.bus, now_ns, n_view);

    for (size_t i = 0; i < n; i++)
        objects[i] = list->objects[allowed[i]];
    list->n_picked = pick_objects(objects, n, room, list->picked);
    for (size_t i = 0; i < list->n_picked; i++)
        list->picked[i] = allowed[list->picked[i]];
    bus_budget_begin(&s->budget, &s->cfg.bus, now_ns, list->n_picked, n_view);
    return list->n_picked == n;
}

static bool is_stale(const struct sender *s, const struct sender_list *list,
                     int64_t now_ns)
{
    return s->cfg.stale_ns &&
           age_ms(now_ns, list->capture_ns) > 1e-6 * (double)s->cfg.stale_ns;
}

void sender_finalize(struct sender *s, struct sender_list *list, int64_t now_ns,
                     int64_t last_ns)
{
    struct can_list_header header = list->header;
    int64_t capture_ns = list->capture_ns;

    list->stale = is_stale(s, list, now_ns);
    header.truncated |= !sender_pick(s, list, now_ns);
    header.number = (uint8_t)list->n_picked;
    list->truncated = header.truncated;
    header.time_sync = s->time_sync;
    header.latency_ms = capture_ns ? latency_ms(now_ns, capture_ns) : NAN;
    header.cycle_ms = last_ns ? age_ms(now_ns, last_ns) : NAN;
    can_pack_list_header(&list->frames[0], s->cfg.base_id, &header);
    list->n_frames = 1;
    list->claims = false;
    pack_view(s, list);
    can_pack_time(&list->frames[list->n_frames++], s->cfg.base_id,
                  (int64_t)((uint64_t)(capture_ns ? capture_ns : now_ns) +
                            (uint64_t)s->wall_ahead_ns));
    for (size_t i = 0; i < list->n_picked; i++) {
        struct can_object o = list->objects[list->picked[i]];
        o.measurement = told_measurement(s, list, &o);
        pack_object(s, list, &o);
    }
}

bool sender_holds(const struct sender *s, const struct sender_list *list, int64_t now_ns)
{
    return (!list->n_picked && !list->claims) ||
           (s->lets_objects && (list->stale || !is_stale(s, list, now_ns)));
}

void sender_sent(struct sender *s, const struct sender_list *list)
{
    for (size_t i = 0; s->lets_objects && i < list->n_picked; i++)
        s->told[list->objects[list->picked[i]].id] = true;
    sender_dropped(s, list);
}

/* What ended is not known any more, also if that was not told: its id comes again. */
void sender_dropped(struct sender *s, const struct sender_list *list)
{
    for (size_t id = 0; id < sizeof s->told; id++)
        s->told[id] &= list->lives[id];
}

void sender_status(const struct sender *s, struct can_frame_data *frame)
{
    can_pack_status(frame, s->cfg.base_id, &s->status);
}

void sender_diagnosis(const struct sender *s, struct can_frame_data *frame)
{
    can_pack_diagnosis(frame, s->cfg.base_id, &s->diagnosis);
}

int sender_send(struct sender *s, struct canbus *bus, const struct can_frame_data *frame,
                int64_t now_ns)
{
    struct can_frame_data f = *frame;

    can_protect(&s->protection, &f);
    int err = canbus_send(bus, &f, now_ns);
    if (!err)
        can_protection_sent(&s->protection, &f);
    return err;
}
