/* SPDX-License-Identifier: MIT */
/* anlos/anlos.h -- hearing around corners: libanlos, all of it.  Begin with
 * anlos/survey.h and anlos/pipeline.h, which does everything; its stages stand by
 * themselves beside it.  anlos/version.h has the rules (threads, units, versions).  Link
 * with `pkg-config --libs anlos`, or -lanlos. */
#ifndef ANLOS_ANLOS_H
#define ANLOS_ANLOS_H

#include <anlos/compressor.h>
#include <anlos/config.h>
#include <anlos/detector.h>
#include <anlos/ego.h>
#include <anlos/error.h>
#include <anlos/image.h>
#include <anlos/imager.h>
#include <anlos/objects.h>
#include <anlos/ping.h>
#include <anlos/pipeline.h>
#include <anlos/static_array.h>
#include <anlos/survey.h>
#include <anlos/tracker.h>
#include <anlos/version.h>
#include <anlos/wall_finder.h>
#include <anlos/walls.h>

#endif
