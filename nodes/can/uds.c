/* SPDX-License-Identifier: MIT */
#include "nodes/can/uds.h"

#include <math.h>
#include <string.h>

#define ANSWER   0x40 /* of a service */
#define NEGATIVE 0x7f
#define SUPPRESS 0x80 /* bit of a sub-function: no positive answer is wanted */

#define DEFAULT_SESSION 0x01
#define ALL_CODES       0xffffffu
#define ALL_RECORDS     0xff
#define CODE_FORMAT     0x01 /* ISO_14229-1_DTCFormat: three bytes, the maker's */
#define NAME            "anlos"

enum { ROUTINE_START = 1, ROUTINE_RESULTS = 3 };

_Static_assert(sizeof ANLOS_VERSION <= 16 &&
                   UDS_MAX_IDENTIFIERS * (2 + 16) + 1 <= UDS_ANSWER_SIZE,
               "no room");

struct answer {
    uint8_t *data;
    size_t n;
};

struct exchange { /* a request and what is made of it */
    struct trouble_memory *memory;
    const struct freeze_frame *now;
    const uint8_t *request;
    size_t size;
    struct answer answer;
};

static void put(struct answer *a, uint64_t value, size_t bytes)
{
    while (bytes-- > 0)
        a->data[a->n++] = (uint8_t)(value >> 8 * bytes);
}

static void put_text(struct answer *a, const char *text)
{
    size_t n = strlen(text);

    memcpy(a->data + a->n, text, n);
    a->n += n;
}

static void put_figure(struct answer *a, double value, double step)
{
    double raw = round(value / step);

    put(a, isnan(raw) ? 0x8000 : (uint16_t)(int16_t)fmax(-32767, fmin(raw, 32767)), 2);
}

static bool is_figure(unsigned id)
{
    return id >= UDS_UNIX_MS && id <= UDS_TEMPERATURE;
}

static void put_of_frame(struct answer *a, unsigned id, const struct freeze_frame *f)
{
    put(a, id, 2);
    switch (id) {
    case UDS_UNIX_MS:
        put(a, f->unix_ms, 8);
        break;
    case UDS_STATE:
        put(a, f->state, 1);
        break;
    case UDS_FAULTS:
        put(a, f->faults, 2);
        break;
    case UDS_LATENCY:
        put_figure(a, f->latency_s, 1e-3);
        break;
    case UDS_NOISE:
        put_figure(a, f->noise_db, 0.1);
        break;
    case UDS_SNR:
        put_figure(a, f->snr_db, 0.1);
        break;
    case UDS_RANGE:
        put_figure(a, f->range_m, 0.01);
        break;
    default:
        put_figure(a, f->temperature_c, 0.1);
    }
}

static void put_identifier(struct answer *a, unsigned id, const struct freeze_frame *now)
{
    if (is_figure(id)) {
        put_of_frame(a, id, now);
    } else if (id == UDS_SESSION || id == UDS_SOFTWARE_VERSION || id == UDS_SYSTEM_NAME) {
        put(a, id, 2);
        if (id == UDS_SESSION)
            put(a, DEFAULT_SESSION, 1);
        else
            put_text(a, id == UDS_SYSTEM_NAME ? NAME : ANLOS_VERSION);
    }
}

/* -- services: each answers after its identifier, or refuses ----------------------------
 */

static int session(struct exchange *e)
{
    if ((e->request[1] & ~SUPPRESS) != DEFAULT_SESSION)
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    if (e->size != 2)
        return UDS_WRONG_LENGTH;
    put(&e->answer, DEFAULT_SESSION, 1);
    put(&e->answer, UDS_P2_MS, 2);
    put(&e->answer, UDS_P2_STAR_MS / 10, 2);
    return 0;
}

static int tester_present(struct exchange *e)
{
    if (e->request[1] & ~SUPPRESS)
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    if (e->size != 2)
        return UDS_WRONG_LENGTH;
    put(&e->answer, 0, 1);
    return 0;
}

static int read_data(struct exchange *e)
{
    size_t before = e->answer.n;

    if (e->size < 3 || e->size % 2 == 0 || e->size > 1 + 2 * UDS_MAX_IDENTIFIERS)
        return UDS_WRONG_LENGTH;
    for (size_t i = 1; i < e->size; i += 2)
        put_identifier(&e->answer, e->request[i] << 8 | e->request[i + 1], e->now);
    return e->answer.n == before ? UDS_OUT_OF_RANGE : 0;
}

static unsigned read_code(const uint8_t *data)
{
    return (unsigned)data[0] << 16 | (unsigned)data[1] << 8 | data[2];
}

/* CAN_FAULTS: there is no such code. */
static int fault_of(const struct trouble_memory *m, unsigned code)
{
    int f = 0;

    while (f < CAN_FAULTS && (UDS_CODE(f) != code || !trouble_supports(m, f)))
        f++;
    return f;
}

static int clear(struct exchange *e)
{
    if (e->size != 4)
        return UDS_WRONG_LENGTH;
    unsigned code = read_code(e->request + 1);
    int fault = fault_of(e->memory, code);
    if (fault == CAN_FAULTS && code != ALL_CODES)
        return UDS_OUT_OF_RANGE;
    for (int f = 0; f < CAN_FAULTS; f++)
        if (f == fault || code == ALL_CODES)
            trouble_clear(e->memory, f);
    return 0;
}

static bool is_asked_for(const struct trouble_memory *m, int fault, unsigned mask)
{
    return trouble_supports(m, fault) &&
           (m->codes[fault].status & mask & TROUBLE_AVAILABLE);
}

static void put_code(struct exchange *e, int fault)
{
    put(&e->answer, UDS_CODE(fault), 3);
    put(&e->answer, e->memory->codes[fault].status, 1);
}

static int count_codes(struct exchange *e)
{
    unsigned n = 0;

    for (int f = 0; f < CAN_FAULTS; f++)
        n += is_asked_for(e->memory, f, e->request[2]);
    put(&e->answer, TROUBLE_AVAILABLE, 1);
    put(&e->answer, CODE_FORMAT, 1);
    put(&e->answer, n, 2);
    return 0;
}

static int list_codes(struct exchange *e)
{
    put(&e->answer, TROUBLE_AVAILABLE, 1);
    for (int f = 0; f < CAN_FAULTS; f++)
        if (is_asked_for(e->memory, f, e->request[2]))
            put_code(e, f);
    return 0;
}

static int list_supported(struct exchange *e)
{
    put(&e->answer, TROUBLE_AVAILABLE, 1);
    for (int f = 0; f < CAN_FAULTS; f++)
        if (trouble_supports(e->memory, f))
            put_code(e, f);
    return 0;
}

/* A code without a freeze frame is answered, without one. */
static int read_frame(struct exchange *e)
{
    int fault = fault_of(e->memory, read_code(e->request + 2));
    uint8_t record = e->request[5];

    if (fault == CAN_FAULTS || (record != UDS_RECORD && record != ALL_RECORDS))
        return UDS_OUT_OF_RANGE;
    put_code(e, fault);
    if (!e->memory->codes[fault].has_frame)
        return 0;
    put(&e->answer, UDS_RECORD, 1);
    put(&e->answer, UDS_TEMPERATURE - UDS_UNIX_MS + 1, 1);
    for (unsigned id = UDS_UNIX_MS; id <= UDS_TEMPERATURE; id++)
        put_of_frame(&e->answer, id, &e->memory->codes[fault].first);
    return 0;
}

static int read_codes(struct exchange *e)
{
    static const struct {
        uint8_t id;
        size_t size;
        int (*run)(struct exchange *e);
    } kinds[] = {
        {0x01, 3, count_codes},
        {0x02, 3, list_codes},
        {0x04, 6, read_frame},
        {0x0a, 2, list_supported},
    };
    uint8_t id = e->request[1] & (uint8_t)~SUPPRESS;

    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        if (kinds[i].id != id)
            continue;
        put(&e->answer, id, 1);
        return kinds[i].size == e->size ? kinds[i].run(e) : UDS_WRONG_LENGTH;
    }
    return UDS_SUBFUNCTION_NOT_SUPPORTED;
}

static int put_self_test(struct exchange *e)
{
    const struct self_test *t = &e->memory->self_test;

    if (t->state == SELF_TEST_NEVER)
        return UDS_WRONG_SEQUENCE;
    put(&e->answer, t->state == SELF_TEST_RUNS ? 2 : t->faults != 0, 1);
    put(&e->answer, t->faults, 2);
    return 0;
}

static int routine(struct exchange *e)
{
    uint8_t kind = e->request[1] & (uint8_t)~SUPPRESS;

    if (e->size < 4)
        return UDS_WRONG_LENGTH;
    if ((e->request[2] << 8 | e->request[3]) != UDS_SELF_TEST)
        return UDS_OUT_OF_RANGE;
    if (kind != ROUTINE_START && kind != ROUTINE_RESULTS) /* it ends by itself */
        return UDS_SUBFUNCTION_NOT_SUPPORTED;
    if (e->size != 4)
        return UDS_WRONG_LENGTH;
    put(&e->answer, kind, 1);
    put(&e->answer, UDS_SELF_TEST, 2);
    if (kind == ROUTINE_RESULTS)
        return put_self_test(e);
    return trouble_start_self_test(e->memory) ? 0 : UDS_CONDITIONS_NOT_CORRECT;
}

static const struct service {
    uint8_t id;
    bool has_subfunction;
    int (*run)(struct exchange *e);
} services[] = {
    {0x10, true, session},    {UDS_CLEAR, false, clear}, {0x19, true, read_codes},
    {0x22, false, read_data}, {0x31, true, routine},     {0x3e, true, tester_present},
};

static const struct service *find_service(uint8_t id)
{
    for (size_t i = 0; i < sizeof services / sizeof *services; i++)
        if (services[i].id == id)
            return &services[i];
    return NULL;
}

/* Of all that were asked together only who supports it answers. */
static bool is_silent(int refusal)
{
    return refusal == UDS_SERVICE_NOT_SUPPORTED ||
           refusal == UDS_SUBFUNCTION_NOT_SUPPORTED || refusal == UDS_OUT_OF_RANGE;
}

int uds_answer(struct trouble_memory *m, const struct freeze_frame *now,
               const uint8_t *request, size_t size, bool functional,
               uint8_t answer[UDS_ANSWER_SIZE], size_t *n)
{
    struct exchange e = {.memory = m,
                         .now = now,
                         .request = request,
                         .size = size,
                         .answer = {.data = answer}};

    *n = 0;
    if (!size || request[0] & ANSWER)
        return 0;
    const struct service *s = find_service(request[0]);
    put(&e.answer, request[0] | ANSWER, 1);
    int refusal = !s                                ? UDS_SERVICE_NOT_SUPPORTED
                  : s->has_subfunction && size == 1 ? UDS_WRONG_LENGTH
                                                    : s->run(&e);
    if (!refusal) {
        bool suppressed = s->has_subfunction && request[1] & SUPPRESS;
        *n = suppressed ? 0 : e.answer.n;
    } else if (!functional || !is_silent(refusal)) {
        answer[0] = NEGATIVE;
        answer[1] = request[0];
        answer[2] = (uint8_t)refusal;
        *n = 3;
    }
    return refusal;
}
