/* SPDX-License-Identifier: MIT */
/* tests/msgs/two_folders.h -- two hosts, vehicle with array and computer with dsp: two
 * run folders of this machine, and two of its loopback addresses. */
#ifndef ANLOS_TESTS_MSGS_TWO_FOLDERS_H
#define ANLOS_TESTS_MSGS_TWO_FOLDERS_H

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "msgs/hosts.h"
#include "run_folder.h"

static char folders[2][80];
static struct hosts hosts;

static inline void add_host(const char *name, const char *endpoint, const char *node)
{
    struct host *h = &hosts.list[hosts.n++];
    struct error why = {""};
    *h = (struct host){.n_nodes = 1};
    strcpy(h->name, name);
    strcpy(h->nodes[0], node);
    if (host_set_endpoint(h, endpoint, &why) != 0)
        fail_msg("%s", why.text);
}

static inline void write_hosts(void)
{
    for (hosts.here = 0; hosts.here < 2; hosts.here++)
        assert_int_equal(hosts_write(&hosts, folders[hosts.here], NULL), 0);
}

/* Ports below those that the kernel gives out, others in each run of the test. */
static inline void by_tcp_at(const char *vehicle, const char *computer)
{
    static unsigned run;
    unsigned port = 10000 + ((unsigned)getpid() * 7 + run++) % 250 * hosts_n_ports();
    char endpoint[64];
    hosts.n = 0;
    snprintf(endpoint, sizeof endpoint, "tcp://%s:%u", vehicle, port);
    add_host("vehicle", endpoint, "array");
    snprintf(endpoint, sizeof endpoint, "tcp://%s:%u", computer, port);
    add_host("computer", endpoint, "dsp");
}

static inline int make_folders(void **state)
{
    if (make_run_folder(state))
        return -1;
    for (int i = 0; i < 2; i++) {
        snprintf(folders[i], sizeof folders[i], "%s/%d", run_folder, i);
        if (mkdir(folders[i], 0700))
            return -1;
    }
    return 0;
}

static inline int remove_folders(void **state)
{
    char whole[sizeof run_folder];
    strcpy(whole, run_folder);
    for (int i = 0; i < 2; i++) {
        strcpy(run_folder, folders[i]);
        remove_run_folder(state);
    }
    strcpy(run_folder, whole);
    return remove_run_folder(state);
}

/* On host i, from now. */
static inline struct bus *open_on(int i, const char *node, int64_t epoch_ns)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = folders[i], .epoch_ns = epoch_ns};
    struct error why = {""};
    struct bus *b = NULL;
    if (bus_create(&b, &cfg, &why) != 0)
        fail_msg("%s", why.text);
    return b;
}

static inline void publish(struct bus *b, const struct topic *t, const void *data,
                           size_t size)
{
    assert_int_equal(bus_publish(b, t, 0, 0, data, size), 0);
}

/* Until the first one arrives; then no more of them are under way. */
static inline void meet(struct bus *from, const struct topic *t, struct bus *to)
{
    struct bus_message m;
    int64_t end_ms = now_ms() + DEADLINE_MS;
    uint64_t sent = 0;
    do {
        publish(from, t, "hello", 5);
        sent++;
        assert_true(now_ms() < end_ms);
    } while (bus_receive(to, &m, 20) != 0);
    while (m.envelope.sequence + 1 < sent) {
        bus_message_free(&m);
        m = receive(to);
    }
    bus_message_free(&m);
}

static inline void url_of(char url[64], int i, const char *node, const struct topic *t)
{
    snprintf(url, 64, "tcp://%s:%u", hosts.list[i].address,
             hosts_port(&hosts.list[i], node, t));
}

static inline int connect_plainly(int i, const char *node, const struct topic *t)
{
    struct sockaddr_in at = {.sin_family = AF_INET};
    at.sin_port = htons((uint16_t)hosts_port(&hosts.list[i], node, t));
    assert_int_equal(inet_pton(AF_INET, hosts.list[i].address, &at.sin_addr), 1);
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_true(fd >= 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

#endif
