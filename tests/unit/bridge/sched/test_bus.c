/* SPDX-License-Identifier: Apache-2.0 */
/* The thread of a bus: whose port never falls silent, and whose requests come and go. */
#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "log/log_private.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#define QUEUE 8
#define REQUESTS 20000
/* A machine that is very busy may be slow now and then, but not as a rule. */
#define SLOW (400 * DB_NS_PER_MS)
#define SLOW_AT_MOST 20
#define LOST_MS 60000

/* The device is a file, and what is in it is read without an end: /dev/zero. */
static int file_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                     size_t filter_count, db_time now, struct db_port **port)
{
	static int fd;

	(void)filters;
	(void)filter_count;
	(void)now;
	fd = open(bus->device, O_RDWR | O_NONBLOCK | O_CLOEXEC);
	assert_true(fd >= 0);
	*port = (struct db_port *)&fd;
	return 0;
}

static int file_fd(const struct db_port *port)
{
	return *(const int *)port;
}

static void file_close(struct db_port *port)
{
	close(file_fd(port));
}

static ssize_t file_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	(void)now;
	return read(file_fd(port), bytes, size);
}

static ssize_t file_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	(void)port;
	(void)bytes;
	(void)now;
	return (ssize_t)length;
}

static db_time file_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * DB_NS_PER_US;
}

static const struct db_transport file = {
	.name = "file",
	.medium = DB_MEDIUM_SERIAL,
	.open = file_open,
	.close = file_close,
	.fd = file_fd,
	.read = file_read,
	.write = file_write,
	.wire_time = file_wire_time,
};

struct lines {
	atomic_uint refused; /* without the right to real-time priorities */
	atomic_uint lent;
};

static void take_line(void *context, const struct db_log_record *record)
{
	struct lines *lines = context;

	if (strstr(record->text, "cannot run at real-time priority"))
		atomic_fetch_add(&lines->refused, 1);
	else if (strstr(record->text, "runs without its real-time priority"))
		atomic_fetch_add(&lines->lent, 1);
}

/* A cycle that wakes it would hide that something else did not. */
static const struct db_bus_config quiet = {
	.name = (char *)"quiet",
	.transport = &file,
	.device = (char *)"/dev/ptmx",
	.baud = 115200,
	.cycle_ms = 10000,
	.drive_latency_ms = 30,
	.queue = QUEUE,
	.log = DB_LOG_INFO,
};

/* It turns, its cycle goes on, and its priority is others'; the end of the test is that it ends. */
static void test_flooded(void **state)
{
	struct db_bus_config config = quiet;
	struct lines lines = { .refused = 0 };
	struct db_bus_stats stats;
	struct db_log *log;
	struct db_bus *bus;
	uint32_t beats;

	(void)state;
	config.driver = db_driver_find("vsmd-serial");
	config.device = (char *)"/dev/zero";
	config.cycle_ms = 1;
	config.priority = 1;
	assert_int_equal(db_log_new_to(take_line, &lines, &log), 0);
	assert_int_equal(db_bus_new(&config, NULL, 0, log, &bus), 0);
	assert_int_equal(db_bus_start(bus), 0);
	while (atomic_load(&lines.refused) + atomic_load(&lines.lent) == 0)
		sched_yield();
	beats = db_bus_heartbeat(bus);
	while (db_bus_heartbeat(bus) - beats < 10)
		sched_yield();
	db_bus_read_stats(bus, &stats);
	assert_true(stats.cycles > 0);
	/* What was read has reached the schedule. */
	assert_true(stats.garbage_bytes > 0);
	db_bus_free(bus);
	db_log_free(log);
}

static db_time now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

/* Hands over as many as are taken; a drive that is not there is answered in the bus's next turn. */
static uint32_t submit(struct db_bus *bus, uint32_t ticket)
{
	struct db_request request = { .drive = 99, .command = DB_CMD_ENABLE };

	for (request.ticket = ticket; request.ticket <= REQUESTS; request.ticket++) {
		if (!db_bus_submit(bus, &request))
			break;
	}
	return request.ticket;
}

/*
 * Every request comes back, once, and both sides are woken for it. A wake-up that gets lost on its way back
 * would never be made up for; one on its way there only by the thread's next beat, after half a second.
 */
static void test_wake_ups(void **state)
{
	struct db_bus_config config = quiet;
	struct db_request *ended;
	struct db_bus *bus;
	uint32_t submitted = 1;
	uint32_t back = 0;
	unsigned slow = 0;

	(void)state;
	config.driver = db_driver_find("vsmd-serial");
	assert_int_equal(db_bus_new(&config, NULL, 0, NULL, &bus), 0);
	assert_int_equal(db_bus_start(bus), 0);
	while (back < REQUESTS) {
		struct pollfd wait = { .fd = db_bus_completion_fd(bus), .events = POLLIN };
		db_time begun = now_ns();

		submitted = submit(bus, submitted);
		assert_int_equal(poll(&wait, 1, LOST_MS), 1);
		slow += now_ns() - begun > SLOW;
		assert_in_range(slow, 0, SLOW_AT_MOST);
		while ((ended = db_bus_completion(bus)) != NULL) {
			assert_in_range(ended->ticket, 1, submitted - 1);
			assert_int_equal(ended->result, DB_RESULT_FAILED);
			db_bus_release(ended);
			back++;
		}
	}
	/* When all is collected, nobody is woken any more. */
	assert_int_equal(
		poll(&(struct pollfd){ .fd = db_bus_completion_fd(bus), .events = POLLIN }, 1, 0),
		0);
	db_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_flooded),
		cmocka_unit_test(test_wake_ups),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
