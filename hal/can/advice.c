#include "hal/can/advice.h"

#include <stdio.h>

void canbus_advice(char *text, size_t size, enum canbus_state state,
                   const char *interface)
{
    switch (state) {
    case CANBUS_READY:
        text[0] = '\0';
        break;
    case CANBUS_WARNING:
        snprintf(text, size, "%s has many errors: wiring, termination, bit rate?",
                 interface);
        break;
    case CANBUS_PASSIVE:
        snprintf(text, size,
                 "%s is error passive: no other node that acknowledges, or wrong wiring, "
                 "termination or bit rate?",
                 interface);
        break;
    case CANBUS_SILENT:
        snprintf(text, size,
                 "%s let no frame through for a second, frames are held back: no other "
                 "node that acknowledges, or a bus that is full?",
                 interface);
        break;
    case CANBUS_OFF:
        snprintf(text, size,
                 "%s is bus-off, frames are held back until it restarts: by itself after "
                 "`ip link set %s type can restart-ms 100` while it is down, at once by "
                 "`ip link set %s type can restart`",
                 interface, interface, interface);
        break;
    case CANBUS_DOWN:
        snprintf(text, size, "%s is down, frames are held back: `ip link set %s up`",
                 interface, interface);
        break;
    case CANBUS_GONE:
        snprintf(text, size, "%s is gone, frames are held back until it is there again",
                 interface);
        break;
    }
}
