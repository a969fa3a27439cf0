/* nodes/rt/background_mode.h -- what dsp subtracts from each ping. */
#ifndef ANLOS_NODES_RT_BACKGROUND_MODE_H
#define ANLOS_NODES_RT_BACKGROUND_MODE_H

enum background_mode {
    BACKGROUND_NONE,
    BACKGROUND_RECORDED, /* before, without the hidden objects: pings of that pass */
    BACKGROUND_ADAPTIVE  /* the mean of what was heard while the vehicle stood: what
                            stands still is gone too */
};

#endif
