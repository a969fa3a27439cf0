/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile_text.h"

#include "nodes/rt/launchfile.h"

#include <string.h>

#define OPTIONAL  CYAML_FLAG_OPTIONAL
#define NAME_SIZE 64
#define TEXT_SIZE 1024
#define MAX_NODES 16

static const cyaml_schema_value_t node_schema = {
    CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, NAME_SIZE)};
static const cyaml_schema_field_t array_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER, struct launch_text_array, uri, 1,
                           TEXT_SIZE),
    CYAML_FIELD_FLOAT_PTR("person_m", OPTIONAL, struct launch_text_array, person_m),
    CYAML_FIELD_END};
static const cyaml_schema_field_t stage_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER, struct launch_text_stage, uri, 1,
                           TEXT_SIZE),
    CYAML_FIELD_END};
static const cyaml_schema_value_t index_schema = {
    CYAML_VALUE_UINT(CYAML_FLAG_DEFAULT, uint32_t)};
static const cyaml_schema_field_t scan_fields[] = {
    CYAML_FIELD_STRING_PTR("mode", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text_scan,
                           mode, 1, NAME_SIZE),
    CYAML_FIELD_BOOL_PTR("background", OPTIONAL, struct launch_text_scan, background),
    CYAML_FIELD_SEQUENCE("speakers", CYAML_FLAG_POINTER | OPTIONAL,
                         struct launch_text_scan, speakers, &index_schema, 1, 4096),
    CYAML_FIELD_UINT_PTR("background_frames", OPTIONAL, struct launch_text_scan,
                         background_frames),
    CYAML_FIELD_UINT_PTR("window", OPTIONAL, struct launch_text_scan, window),
    CYAML_FIELD_UINT_PTR("retries", OPTIONAL, struct launch_text_scan, retries),
    CYAML_FIELD_FLOAT_PTR("timeout_s", OPTIONAL, struct launch_text_scan, timeout_s),
    CYAML_FIELD_END};
static const cyaml_schema_field_t dsp_fields[] = {
    CYAML_FIELD_STRING_PTR("window", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_dsp, window, 1, NAME_SIZE),
    CYAML_FIELD_STRING_PTR("compression", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_dsp, compression, 1, NAME_SIZE),
    CYAML_FIELD_STRING_PTR("background", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_dsp, background, 1, NAME_SIZE),
    CYAML_FIELD_FLOAT_PTR("background_s", OPTIONAL, struct launch_text_dsp, background_s),
    CYAML_FIELD_END};
#define METHOD_OPTION(name)                                                              \
    CYAML_FIELD_STRING_PTR(#name, CYAML_FLAG_POINTER | OPTIONAL,                         \
                           struct launch_text_options, name, 1, NAME_SIZE)
static const cyaml_schema_field_t option_fields[] = {
    METHOD_OPTION(base),      METHOD_OPTION(iterations), METHOD_OPTION(tolerance),
    METHOD_OPTION(l1),        METHOD_OPTION(tv),         METHOD_OPTION(tv_isotropic),
    METHOD_OPTION(rho),       METHOD_OPTION(snr_db),     METHOD_OPTION(dmo),
    METHOD_OPTION(lightcone), METHOD_OPTION(coherence),  METHOD_OPTION(sharpen),
    CYAML_FIELD_END};
static const cyaml_schema_field_t frames_fields[] = {
    CYAML_FIELD_UINT_PTR("pings", OPTIONAL, struct launch_text_frames, pings),
    CYAML_FIELD_STRING_PTR("sum", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_frames, sum, 1, NAME_SIZE),
    CYAML_FIELD_STRING_PTR("every", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_frames, every, 1, NAME_SIZE),
    CYAML_FIELD_END};
static const cyaml_schema_field_t recon_fields[] = {
    CYAML_FIELD_STRING_PTR("method", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_recon, method, 1, NAME_SIZE),
    CYAML_FIELD_UINT_PTR("threads", OPTIONAL, struct launch_text_recon, threads),
    CYAML_FIELD_BOOL_PTR("preview", OPTIONAL, struct launch_text_recon, preview),
    CYAML_FIELD_MAPPING("frames", OPTIONAL, struct launch_text_recon, frames,
                        frames_fields),
    CYAML_FIELD_MAPPING("options", OPTIONAL, struct launch_text_recon, options,
                        option_fields),
    CYAML_FIELD_END};
#define TRACK_NUMBER(name)                                                               \
    CYAML_FIELD_FLOAT_PTR(#name, OPTIONAL, struct launch_text_track, name)
static const cyaml_schema_field_t track_fields[] = {
    CYAML_FIELD_STRING_PTR("mode", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_track, mode, 1, NAME_SIZE),
    CYAML_FIELD_STRING_PTR("cfar", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_track, cfar, 1, NAME_SIZE),
    TRACK_NUMBER(false_alarm_rate),
    TRACK_NUMBER(threshold_db),
    TRACK_NUMBER(min_existence),
    TRACK_NUMBER(confirm_existence),
    TRACK_NUMBER(detection_probability),
    TRACK_NUMBER(clutter),
    TRACK_NUMBER(sidelobe_db),
    TRACK_NUMBER(look_s),
    TRACK_NUMBER(acceleration_psd),
    TRACK_NUMBER(join_m),
    TRACK_NUMBER(coast_s),
    CYAML_FIELD_UINT_PTR("confirm_hits", OPTIONAL, struct launch_text_track,
                         confirm_hits),
    CYAML_FIELD_UINT_PTR("confirm_of", OPTIONAL, struct launch_text_track, confirm_of),
    CYAML_FIELD_END};
#define DIAGNOSIS_ID(name)                                                               \
    CYAML_FIELD_UINT_PTR(#name, OPTIONAL, struct launch_text_can_diagnosis, name)
static const cyaml_schema_field_t diagnosis_fields[] = {
    DIAGNOSIS_ID(request), DIAGNOSIS_ID(response), DIAGNOSIS_ID(functional),
    CYAML_FIELD_END};
static const cyaml_schema_field_t can_fields[] = {
    CYAML_FIELD_STRING_PTR("uri", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text_can,
                           uri, 1, TEXT_SIZE),
    CYAML_FIELD_UINT_PTR("base_id", OPTIONAL, struct launch_text_can, base_id),
    CYAML_FIELD_UINT_PTR("sensor", OPTIONAL, struct launch_text_can, sensor),
    CYAML_FIELD_BOOL_PTR("fd", OPTIONAL, struct launch_text_can, fd),
    CYAML_FIELD_BOOL_PTR("motion", OPTIONAL, struct launch_text_can, motion),
    CYAML_FIELD_BOOL_PTR("field_of_view", OPTIONAL, struct launch_text_can,
                         field_of_view),
    CYAML_FIELD_UINT_PTR("bitrate", OPTIONAL, struct launch_text_can, bitrate),
    CYAML_FIELD_UINT_PTR("data_bitrate", OPTIONAL, struct launch_text_can, data_bitrate),
    CYAML_FIELD_FLOAT_PTR("load", OPTIONAL, struct launch_text_can, load),
    CYAML_FIELD_MAPPING("diagnosis", OPTIONAL, struct launch_text_can, diagnosis,
                        diagnosis_fields),
    CYAML_FIELD_END};
static const cyaml_schema_value_t number_schema = {
    CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t corner_schema = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number_schema, 2)};
#define WALL_NUMBER(name)                                                                \
    CYAML_FIELD_FLOAT_PTR(#name, OPTIONAL, struct launch_text_wall, name)
static const cyaml_schema_field_t wall_fields[] = {
    CYAML_FIELD_STRING_PTR("from", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text_wall,
                           from, 1, NAME_SIZE),
    CYAML_FIELD_STRING_PTR("prior", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_wall, prior, 1, NAME_SIZE),
    WALL_NUMBER(vertical_deg),
    WALL_NUMBER(reach_m),
    WALL_NUMBER(every_s),
    WALL_NUMBER(lost_s),
    CYAML_FIELD_SEQUENCE("free_view_m", CYAML_FLAG_POINTER | OPTIONAL,
                         struct launch_text_wall, free_view_m, &corner_schema, 0,
                         WALLS_MAX_CORNERS),
    CYAML_FIELD_END};
static const cyaml_schema_field_t report_fields[] = {
    CYAML_FIELD_STRING_PTR("folder", CYAML_FLAG_POINTER, struct launch_text_report,
                           folder, 1, TEXT_SIZE),
    CYAML_FIELD_END};

static const cyaml_schema_field_t host_fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct launch_text_host, name, 1,
                           NAME_SIZE),
    CYAML_FIELD_STRING_PTR("endpoint", CYAML_FLAG_POINTER, struct launch_text_host,
                           endpoint, 1, TEXT_SIZE),
    CYAML_FIELD_STRING_PTR("keys", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text_host,
                           keys, 1, TEXT_SIZE),
    CYAML_FIELD_SEQUENCE("nodes", CYAML_FLAG_POINTER, struct launch_text_host, nodes,
                         &node_schema, 1, MAX_NODES),
    CYAML_FIELD_END};
static const cyaml_schema_value_t host_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct launch_text_host, host_fields)};

#define RECORD_TEXT(name)                                                                \
    CYAML_FIELD_STRING_PTR(#name, CYAML_FLAG_POINTER | OPTIONAL,                         \
                           struct launch_text_record, name, 0, TEXT_SIZE)
#define RECORD_COUNT(name)                                                               \
    CYAML_FIELD_UINT_PTR(#name, OPTIONAL, struct launch_text_record, name)
#define SNAPSHOT_COUNT(name)                                                             \
    CYAML_FIELD_UINT_PTR(#name, OPTIONAL, struct launch_text_snapshot, name)
static const cyaml_schema_field_t snapshot_fields[] = {
    CYAML_FIELD_STRING_PTR("folder", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_snapshot, folder, 1, TEXT_SIZE),
    SNAPSHOT_COUNT(before_s),
    SNAPSHOT_COUNT(after_s),
    SNAPSHOT_COUNT(max_mb),
    CYAML_FIELD_BOOL_PTR("faults", OPTIONAL, struct launch_text_snapshot, faults),
    CYAML_FIELD_END};
static const cyaml_schema_field_t record_fields[] = {
    RECORD_TEXT(path),
    RECORD_TEXT(topics),
    RECORD_TEXT(exclude),
    RECORD_COUNT(split_mb),
    RECORD_COUNT(split_s),
    RECORD_COUNT(quota_mb),
    RECORD_COUNT(flush_ms),
    RECORD_TEXT(compression),
    CYAML_FIELD_BOOL_PTR("shuffle", OPTIONAL, struct launch_text_record, shuffle),
    CYAML_FIELD_MAPPING("snapshot", OPTIONAL, struct launch_text_record, snapshot,
                        snapshot_fields),
    CYAML_FIELD_END};

#define PLAY_TEXT(name)                                                                  \
    CYAML_FIELD_STRING_PTR(#name, CYAML_FLAG_POINTER | OPTIONAL,                         \
                           struct launch_text_play, name, 1, TEXT_SIZE)
#define PLAY_SECONDS(name)                                                               \
    CYAML_FIELD_FLOAT_PTR(#name, OPTIONAL, struct launch_text_play, name)
static const cyaml_schema_field_t play_fields[] = {
    PLAY_TEXT(bag),
    PLAY_TEXT(rate),
    CYAML_FIELD_BOOL_PTR("loop", OPTIONAL, struct launch_text_play, loop),
    PLAY_SECONDS(start_s),
    PLAY_SECONDS(end_s),
    PLAY_TEXT(topics),
    PLAY_TEXT(exclude),
    PLAY_TEXT(remap),
    CYAML_FIELD_END};

static const cyaml_schema_field_t view_fields[] = {
    CYAML_FIELD_STRING_PTR("address", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_view, address, 1, NAME_SIZE),
    CYAML_FIELD_UINT_PTR("port", OPTIONAL, struct launch_text_view, port),
    CYAML_FIELD_BOOL_PTR("save", OPTIONAL, struct launch_text_view, save),
    CYAML_FIELD_STRING_PTR("bag", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text_view,
                           bag, 1, TEXT_SIZE),
    CYAML_FIELD_END};

static const cyaml_schema_field_t processes_fields[] = {
    CYAML_FIELD_FLOAT_PTR("alive_s", OPTIONAL, struct launch_text_processes, alive_s),
    CYAML_FIELD_STRING_PTR("realtime", CYAML_FLAG_POINTER | OPTIONAL,
                           struct launch_text_processes, realtime, 1, NAME_SIZE),
    CYAML_FIELD_END};

static const cyaml_schema_field_t launch_fields[] = {
    CYAML_FIELD_SEQUENCE("nodes", CYAML_FLAG_POINTER, struct launch_text, nodes,
                         &node_schema, 1, MAX_NODES),
    CYAML_FIELD_MAPPING("array", OPTIONAL, struct launch_text, array, array_fields),
    CYAML_FIELD_MAPPING("stage", OPTIONAL, struct launch_text, stage, stage_fields),
    CYAML_FIELD_MAPPING("scan", OPTIONAL, struct launch_text, scan, scan_fields),
    CYAML_FIELD_MAPPING("dsp", OPTIONAL, struct launch_text, dsp, dsp_fields),
    CYAML_FIELD_MAPPING("recon", OPTIONAL, struct launch_text, recon, recon_fields),
    CYAML_FIELD_MAPPING("track", OPTIONAL, struct launch_text, track, track_fields),
    CYAML_FIELD_MAPPING("can", OPTIONAL, struct launch_text, can, can_fields),
    CYAML_FIELD_MAPPING("wall", OPTIONAL, struct launch_text, wall, wall_fields),
    CYAML_FIELD_MAPPING("report", OPTIONAL, struct launch_text, report, report_fields),
    CYAML_FIELD_MAPPING("view", OPTIONAL, struct launch_text, view, view_fields),
    CYAML_FIELD_MAPPING("record", OPTIONAL, struct launch_text, record, record_fields),
    CYAML_FIELD_MAPPING("play", OPTIONAL, struct launch_text, play, play_fields),
    CYAML_FIELD_MAPPING("processes", OPTIONAL, struct launch_text, processes,
                        processes_fields),
    CYAML_FIELD_SEQUENCE("hosts", CYAML_FLAG_POINTER | OPTIONAL, struct launch_text,
                         hosts, &host_schema, 1, CYAML_UNLIMITED),
    CYAML_FIELD_END};
const struct cyaml_schema_value launch_text_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct launch_text, launch_fields)};

const char *launch_text_option(const struct launch_text *t, const char *name)
{
    for (const cyaml_schema_field_t *f = option_fields; f->key; f++)
        if (!strcmp(f->key, name))
            return *(char *const *)((const char *)&t->recon.options + f->data_offset);
    return NULL;
}
