/* SPDX-License-Identifier: MIT */
/* nodes/rt/uri.h -- device URIs, "scheme:path?key=value&key=value", as the launch file
 * has them.  Results are on the heap: free() them; NULL means no memory. */
#ifndef ANLOS_NODES_RT_URI_H
#define ANLOS_NODES_RT_URI_H

#include <stdbool.h>

bool uri_has_scheme(const char *uri, const char *scheme);

/* The path without scheme and options; may be empty. */
char *uri_path(const char *uri);

/* The value of an option; empty when it has none. */
char *uri_option(const char *uri, const char *key);

/* The URI with its relative path put into a folder. */
char *uri_in_folder(const char *uri, const char *folder);

/* The URI with the relative path in option `key`, if it has one, put into a folder. */
char *uri_option_in_folder(const char *uri, const char *folder, const char *key);

/* The URI with the option set, in the place of an earlier value if it has one. */
char *uri_set_option(const char *uri, const char *key, const char *value);

/* *uri, on the heap, becomes a result of the above.  0, -ENOMEM (it is NULL). */
int uri_replace(char **uri, char *result);

#endif
