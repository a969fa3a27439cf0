/* nodes/report/report_json.h -- report.json: how the scan went. */
#ifndef ANLOS_NODES_REPORT_REPORT_JSON_H
#define ANLOS_NODES_REPORT_REPORT_JSON_H

#include <jansson.h>

#include "nodes/report/report.h"

/* NULL: no memory. */
json_t *report_json(const struct report *r);

#endif
