/* SPDX-License-Identifier: MIT */
/* The guest has the drivers that the other tests in this folder rely on.  Nothing of
 * anlos is used here: a guest that is broken is told from a program that is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <alsa/asoundlib.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/gpio.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { DEADLINE_MS = 60000, N_CHANNELS = 32, N_FRAMES = 1600, N_SILENT = 80000 };

static int can_open(const char *interface)
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    int on = 1;
    int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);

    assert_true(fd >= 0);
    address.can_ifindex = (int)if_nametoindex(interface);
    assert_int_not_equal(address.can_ifindex, 0);
    assert_int_equal(setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on)), 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&address, sizeof(address)), 0);
    return fd;
}

static void assert_frame_passes(const char *from, const char *to)
{
    struct canfd_frame sent = {.can_id = 0x123, .len = CANFD_MAX_DLEN};
    struct canfd_frame heard;
    int sender = can_open(from);
    struct pollfd receiver = {.fd = can_open(to), .events = POLLIN};

    for (size_t i = 0; i < CANFD_MAX_DLEN; i++)
        sent.data[i] = (unsigned char)(3 * i + 1);
    assert_int_equal(write(sender, &sent, CANFD_MTU), CANFD_MTU);
    assert_int_equal(poll(&receiver, 1, DEADLINE_MS), 1);
    assert_int_equal(read(receiver.fd, &heard, sizeof(heard)), CANFD_MTU);
    assert_int_equal(heard.can_id, sent.can_id);
    assert_memory_equal(heard.data, sent.data, CANFD_MAX_DLEN);
    close(receiver.fd);
    close(sender);
}

static void a_fd_frame_passes_between_sockets_of_vcan0(void **state)
{
    (void)state;
    assert_frame_passes("vcan0", "vcan0");
}

static void a_fd_frame_passes_through_the_vxcan_pair_both_ways(void **state)
{
    (void)state;
    assert_frame_passes("vxcan0", "vxcan1");
    assert_frame_passes("vxcan1", "vxcan0");
}

static const char *environment(const char *name)
{
    const char *value = getenv(name);

    if (!value)
        fail_msg("%s is not set: this runs in tests/hw/guest only", name);
    return value;
}

static void pull(unsigned int line, const char *where)
{
    char path[256];
    FILE *file;

    snprintf(path, sizeof(path), "%s/sim_gpio%u/pull", environment("GUEST_GPIO_SYSFS"),
             line);
    file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(where, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* A request for one line as an input that reports both edges. */
static int line_open(int chip, unsigned int line)
{
    struct gpio_v2_line_request request = {.num_lines = 1, .consumer = "test"};

    request.offsets[0] = line;
    request.config.flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING |
                           GPIO_V2_LINE_FLAG_EDGE_FALLING;
    assert_int_equal(ioctl(chip, GPIO_V2_GET_LINE_IOCTL, &request), 0);
    return request.fd;
}

static void assert_edge(int fd, unsigned int id)
{
    struct gpio_v2_line_event event;
    struct pollfd edge = {.fd = fd, .events = POLLIN};

    assert_int_equal(poll(&edge, 1, DEADLINE_MS), 1);
    assert_int_equal(read(fd, &event, sizeof(event)), sizeof(event));
    assert_int_equal(event.id, id);
}

static void the_chip_has_sixteen_named_lines_whose_pulls_are_edges(void **state)
{
    struct gpiochip_info info;
    struct gpio_v2_line_info line = {.offset = 15};
    int chip = open(environment("GUEST_GPIOCHIP"), O_RDWR | O_CLOEXEC);
    int fd;

    (void)state;
    assert_true(chip >= 0);
    assert_int_equal(ioctl(chip, GPIO_GET_CHIPINFO_IOCTL, &info), 0);
    assert_string_equal(info.label, "anlos-sim");
    assert_int_equal(info.lines, 16);
    assert_int_equal(ioctl(chip, GPIO_V2_GET_LINEINFO_IOCTL, &line), 0);
    assert_string_equal(line.name, "sim15");
    fd = line_open(chip, 7);
    pull(7, "pull-up");
    assert_edge(fd, GPIO_V2_LINE_EVENT_RISING_EDGE);
    pull(7, "pull-down");
    assert_edge(fd, GPIO_V2_LINE_EVENT_FALLING_EDGE);
    close(fd);
    close(chip);
}

/* The buffer holds all that is played before it starts. */
static snd_pcm_t *pcm_open(const char *device, snd_pcm_stream_t direction)
{
    snd_pcm_t *pcm;

    assert_int_equal(snd_pcm_open(&pcm, device, direction, 0), 0);
    assert_int_equal(snd_pcm_set_params(pcm, SND_PCM_FORMAT_S16_LE,
                                        SND_PCM_ACCESS_RW_INTERLEAVED, N_CHANNELS, 8000,
                                        0, 2000000),
                     0);
    return pcm;
}

/* The far end hears silence, then what is played: reads until that begins. */
static void skip_silence(snd_pcm_t *in, int16_t *frame)
{
    for (size_t i = 0; i < N_SILENT; i++) {
        assert_int_equal(snd_pcm_readi(in, frame, 1), 1);
        if (frame[0])
            return;
    }
    fail_msg("nothing was heard in %d frames", N_SILENT);
}

static void thirty_two_channels_pass_the_loopback_bit_by_bit(void **state)
{
    static int16_t played[N_FRAMES * N_CHANNELS];
    static int16_t heard[N_FRAMES * N_CHANNELS];
    snd_pcm_t *out = pcm_open("hw:Loopback,0,7", SND_PCM_STREAM_PLAYBACK);
    snd_pcm_t *in = pcm_open("hw:Loopback,1,7", SND_PCM_STREAM_CAPTURE);

    (void)state;
    for (size_t i = 0; i < N_FRAMES * N_CHANNELS; i++)
        played[i] = (int16_t)(i * 40503 + 1);
    assert_int_equal(snd_pcm_writei(out, played, N_FRAMES), N_FRAMES);
    assert_int_equal(snd_pcm_start(in), 0);
    assert_int_equal(snd_pcm_start(out), 0);
    skip_silence(in, heard);
    assert_int_equal(snd_pcm_readi(in, heard + N_CHANNELS, N_FRAMES - 1), N_FRAMES - 1);
    assert_memory_equal(heard, played, sizeof(played));
    snd_pcm_close(in);
    snd_pcm_close(out);
    snd_config_update_free_global();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fd_frame_passes_between_sockets_of_vcan0),
        cmocka_unit_test(a_fd_frame_passes_through_the_vxcan_pair_both_ways),
        cmocka_unit_test(the_chip_has_sixteen_named_lines_whose_pulls_are_edges),
        cmocka_unit_test(thirty_two_channels_pass_the_loopback_bit_by_bit),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
