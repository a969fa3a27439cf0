/* SPDX-License-Identifier: MIT */
/* What systemd is told: by the rule on a clock of the test's own, and by a launcher that
 * runs, over the socket that systemd would give it. */
#include "tests/hal/scratch.h"

#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/launcher/service.h"

#define S           1000000000LL
#define DEADLINE_MS 30000

static char told[200];

static int listen_in(const char *state)
{
    strcat(strcat(told, state), " ");
    return 1;
}

/* A scan and a dsp, both running, watched every 8 s. */
static void start(struct service *s, struct process_group *c)
{
    *s = (struct service){.watchdog_ns = 8 * S, .notify = listen_in};
    *c = (struct process_group){.n = 2,
                                .children = {{.name = "scan", .started_ns = 100 * S},
                                             {.name = "dsp", .started_ns = 100 * S}}};
    told[0] = '\0';
}

static void it_is_ready_when_every_node_has_spoken(void **state)
{
    struct service s;
    struct process_group c;

    (void)state;
    start(&s, &c);
    s.watchdog_ns = 0;
    service_tick(&s, &c, 100 * S);
    service_heard(&s, &c, "scan", 101 * S);
    service_heard(&s, &c, "can", 101 * S); /* of somebody else */
    service_tick(&s, &c, 101 * S);
    assert_string_equal(told, "");
    service_heard(&s, &c, "dsp", 102 * S);
    assert_true(service_tick(&s, &c, 102 * S) > 1000000 * S);
    service_tick(&s, &c, 103 * S);
    assert_string_equal(told, "READY=1 ");
}

static void it_is_alive_while_every_node_speaks(void **state)
{
    struct service s;
    struct process_group c;

    (void)state;
    start(&s, &c);
    service_heard(&s, &c, "scan", 101 * S);
    service_heard(&s, &c, "dsp", 101 * S);
    assert_int_equal(service_tick(&s, &c, 101 * S), 103 * S);
    service_tick(&s, &c, 102 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 ");
    service_heard(&s, &c, "scan", 105 * S); /* dsp hangs */
    service_tick(&s, &c, 105 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 ");
    service_tick(&s, &c, 107 * S);
    service_tick(&s, &c, 109 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 ");
    service_heard(&s, &c, "scan", 110 * S);
    service_heard(&s, &c, "dsp", 110 * S);
    service_tick(&s, &c, 111 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 WATCHDOG=1 ");
}

static void who_is_supervised_may_be_busy_for_longer(void **state)
{
    struct service s;
    struct process_group c;

    (void)state;
    start(&s, &c);
    s.supervised = true;
    service_heard(&s, &c, "scan", 101 * S);
    service_heard(&s, &c, "dsp", 101 * S);
    service_tick(&s, &c, 101 * S);
    service_tick(&s, &c, 120 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 ");
}

static void a_node_that_is_started_again_has_its_time(void **state)
{
    struct service s;
    struct process_group c;

    (void)state;
    start(&s, &c);
    service_heard(&s, &c, "scan", 101 * S);
    service_heard(&s, &c, "dsp", 101 * S);
    c.children[1].phase = CHILD_PAUSING;
    service_heard(&s, &c, "scan", 108 * S);
    service_tick(&s, &c, 108 * S);
    c.children[1].phase = CHILD_RUNNING;
    c.children[1].started_ns = 108 * S;
    service_tick(&s, &c, 112 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 ");
    service_heard(&s, &c, "scan", 114 * S);
    service_tick(&s, &c, 114 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 WATCHDOG=1 ");
}

static void one_that_has_ended_by_itself_is_not_waited_for(void **state)
{
    struct service s;
    struct process_group c;

    (void)state;
    start(&s, &c);
    c.children[1].phase = CHILD_ENDED;
    service_heard(&s, &c, "scan", 110 * S);
    service_tick(&s, &c, 110 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 ");
    service_ends(&s);
    service_tick(&s, &c, 200 * S);
    assert_string_equal(told, "READY=1 WATCHDOG=1 STOPPING=1 ");
}

static int open_socket(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    assert_true(fd >= 0 && strlen(path) < sizeof address.sun_path);
    strcpy(address.sun_path, path);
    assert_int_equal(bind(fd, (const struct sockaddr *)&address, sizeof address), 0);
    return fd;
}

static void wait_for(int fd, const char *word)
{
    char text[300] = "";

    while (!strstr(text, word)) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        if (poll(&p, 1, DEADLINE_MS) <= 0)
            fail_msg("the launcher does not say %s", word);
        ssize_t n = recv(fd, text, sizeof text - 1, 0);
        assert_true(n >= 0);
        text[n] = '\0';
    }
}

static void exec_launcher(struct scratch *s, const char *launch, const char *notify)
{
    char pid[24];

    snprintf(pid, sizeof pid, "%ld", (long)getpid());
    setenv("NOTIFY_SOCKET", notify, 1);
    setenv("WATCHDOG_USEC", "20000000", 1);
    setenv("WATCHDOG_PID", pid, 1);
    if (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr))
        _exit(98);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir", s->folder,
          "--out", s->folder, NULL);
    _exit(99);
}

static void a_launcher_tells_systemd_over_its_socket(void **state)
{
    struct scratch *s = *state;
    int status, fd = open_socket(scratch_path(s, "notify"));
    char *notify = strdup(s->path);
    char *launch =
        strdup(scratch_write(s, "launch.yaml", "nodes: [can]\nreport: {folder: out}\n"));
    pid_t pid = fork();

    assert_true(pid >= 0 && notify && launch);
    if (!pid)
        exec_launcher(s, launch, notify);
    wait_for(fd, "READY=1");
    wait_for(fd, "WATCHDOG=1");
    kill(pid, SIGTERM);
    wait_for(fd, "STOPPING=1");
    assert_int_equal(waitpid(pid, &status, 0), pid);
    close(fd);
    free(notify);
    free(launch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_ready_when_every_node_has_spoken),
        cmocka_unit_test(it_is_alive_while_every_node_speaks),
        cmocka_unit_test(who_is_supervised_may_be_busy_for_longer),
        cmocka_unit_test(a_node_that_is_started_again_has_its_time),
        cmocka_unit_test(one_that_has_ended_by_itself_is_not_waited_for),
        cmocka_unit_test_setup_teardown(a_launcher_tells_systemd_over_its_socket,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
