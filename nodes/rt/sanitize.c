/* SPDX-License-Identifier: MIT */
/* nodes/rt/sanitize.c -- only in builds with AddressSanitizer: what is not ours to free.
 */

const char *__lsan_default_suppressions(void);
const char *__lsan_default_options(void);

/* fontconfig, behind cairo, loses some hundred bytes of its configuration. */
const char *__lsan_default_suppressions(void)
{
    return "leak:libfontconfig\n";
}

const char *__lsan_default_options(void)
{
    return "print_suppressions=0";
}
