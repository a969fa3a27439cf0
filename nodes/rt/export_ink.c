/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_ink.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "nodes/rt/export.h"

void ink_text(cairo_t *cr, double x, double y, double size, enum ink_anchor anchor,
              const char *text)
{
    cairo_text_extents_t e, digit;

    cairo_set_font_size(cr, size);
    cairo_text_extents(cr, text, &e);
    cairo_text_extents(cr, "0", &digit);
    x -= anchor == INK_RIGHT ? e.x_advance : anchor == INK_CENTRE ? e.x_advance / 2 : 0;
    cairo_move_to(cr, x, y + digit.height / 2);
    cairo_show_text(cr, text);
}

double ink_tick_step(double span, double n)
{
    double decade = pow(10.0, floor(log10(span / n)));
    double steps = span / n / decade;
    return decade * (steps <= 1.0 ? 1.0 : steps <= 2.0 ? 2.0 : steps <= 5.0 ? 5.0 : 10.0);
}

int ink_digits(double step)
{
    return (int)fmax(0.0, ceil(-log10(step) - 1e-9));
}

cairo_status_t ink_write(void *to, const unsigned char *data, unsigned size)
{
    return fwrite(data, 1, size, to) == size ? CAIRO_STATUS_SUCCESS
                                             : CAIRO_STATUS_WRITE_ERROR;
}

int ink_png(const char *folder, const char *name, cairo_surface_t *surface,
            struct error *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, name, why);

    if (err)
        return err;
    errno = 0;
    cairo_status_t status = cairo_surface_write_to_png_stream(surface, ink_write, e.f);
    if (status == CAIRO_STATUS_NO_MEMORY)
        return export_file_abandon(&e, -ENOMEM, why);
    if (status != CAIRO_STATUS_SUCCESS)
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}
