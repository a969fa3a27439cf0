#include "nodes/can/sender.h"

#include <math.h>

void sender_init(struct sender *s, uint32_t base_id)
{
    *s = (struct sender){.base_id = base_id,
                         .status = {.state = CAN_INIT,
                                    .source = CAN_SOURCE_UNKNOWN,
                                    .temperature_c = NAN}};
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
    s->status.source = source_of(survey->source);
    s->status.temperature_c = survey->temperature_c;
    s->status.sound_speed_m_s = survey->sound_speed_m_s;
}

void sender_scan(struct sender *s, const Anlos__ScanStatus *status)
{
    switch (status->state) {
    case ANLOS__SCAN_STATUS__STATE__WAITING:
        s->status.state = CAN_INIT;
        break;
    case ANLOS__SCAN_STATUS__STATE__RUNNING:
        s->status.state = status->pass == ANLOS__PASS__BACKGROUND ? CAN_CALIBRATING
                                                                  : CAN_ACTIVE;
        break;
    case ANLOS__SCAN_STATUS__STATE__DONE:
        s->status.state = status->pings_lost ? CAN_DEGRADED : CAN_ACTIVE;
        break;
    default: /* failed, or paused until a person comes */
        s->status.state = CAN_FAULT;
    }
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
        o->sigma_m[0] = sqrt(fmax(c[0], 0.0));
        o->sigma_m[1] = sqrt(fmax(c[3], 0.0));
        double product = o->sigma_m[0] * o->sigma_m[1];
        o->correlation = product > 0.0 ? c[1] / product : 0.0;
    }
    if (d->extent_m) { /* in the position's frame */
        o->length_m = d->extent_m->x;
        o->width_m = d->extent_m->y;
    }
}

static void fill_object(struct can_object *o, const Anlos__DetectionList *list, size_t i)
{
    const Anlos__Detection *d = list->detections[i];

    *o = (struct can_object){.id = (uint8_t)d->id,
                             .counter = (uint8_t)list->counter,
                             .position_m = {NAN, NAN, NAN},
                             .measurement = CAN_NEW, /* lists do not know each other */
                             .existence = d->existence,
                             .velocity_m_s = {NAN, NAN}, /* nothing measures it */
                             .sigma_m = {NAN, NAN},
                             .correlation = NAN,
                             .length_m = NAN,
                             .width_m = NAN};
    if (list->mirrored && list->in_vehicle_frame)
        fill_place(o, d);
}

void sender_list(const struct sender *s, const Anlos__DetectionList *list,
                 int64_t capture_ns, struct sender_list *out)
{
    size_t n = list->n_detections < CAN_MAX_OBJECTS ? list->n_detections
                                                    : CAN_MAX_OBJECTS;
    struct can_frame_data *frame = out->frames + 2;

    out->header = (struct can_list_header){.number = (uint8_t)n,
                                           .counter = (uint16_t)list->counter,
                                           .truncated = n < list->n_detections};
    out->capture_ns = capture_ns;
    out->dated_ns = 0;
    out->n_frames = 2 + 3 * n;
    for (size_t i = 0; i < n; i++) {
        struct can_object object;
        fill_object(&object, list, i);
        can_pack_object_state(frame++, s->base_id, &object);
        can_pack_object_dynamics(frame++, s->base_id, &object);
        can_pack_object_quality(frame++, s->base_id, &object);
    }
}

/* In ms, modulo 2^64 ns: a stamp is whatever its sender wrote. */
static double age_ms(int64_t now_ns, int64_t then_ns)
{
    return 1e-6 * (double)(int64_t)((uint64_t)now_ns - (uint64_t)then_ns);
}

void sender_date(const struct sender *s, struct sender_list *list, int64_t now_ns,
                 int64_t last_ns)
{
    int64_t capture_ns = list->capture_ns;

    list->header.latency_ms = capture_ns ? age_ms(now_ns, capture_ns) : NAN;
    list->header.cycle_ms = last_ns ? age_ms(now_ns, last_ns) : NAN;
    can_pack_list_header(&list->frames[0], s->base_id, &list->header);
    can_pack_time(&list->frames[1], s->base_id, capture_ns ? capture_ns : now_ns);
}

void sender_status(const struct sender *s, struct can_frame_data *frame)
{
    can_pack_status(frame, s->base_id, &s->status);
}
