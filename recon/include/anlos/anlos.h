/* anlos/anlos.h -- hearing around corners: libanlos, all of it.  Begin with
 * anlos/survey.h and anlos/pipeline.h; anlos/version.h has the rules (threads, units,
 * versions).  Link with `pkg-config --libs anlos`, or -lanlos. */
#ifndef ANLOS_ANLOS_H
#define ANLOS_ANLOS_H

#include <anlos/error.h>
#include <anlos/image.h>
#include <anlos/objects.h>
#include <anlos/ping.h>
#include <anlos/pipeline.h>
#include <anlos/survey.h>
#include <anlos/version.h>
#include <anlos/walls.h>

#endif
