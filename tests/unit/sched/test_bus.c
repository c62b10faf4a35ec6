/* SPDX-License-Identifier: Apache-2.0 */
/* The thread of a bus whose port never falls silent. */
#include "drivebridge/bus.h"
#include "drivebridge/driver.h"
#include "log/log.h"

#include <fcntl.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

/* /dev/zero is always readable. */
static int flood_open(const struct db_bus_config *bus, const struct db_can_filter *filters,
                      size_t filter_count, db_time now, struct db_port **port)
{
	static int fd;

	(void)bus;
	(void)filters;
	(void)filter_count;
	(void)now;
	fd = open("/dev/zero", O_RDONLY | O_CLOEXEC);
	assert_true(fd >= 0);
	*port = (struct db_port *)&fd;
	return 0;
}

static int flood_fd(const struct db_port *port)
{
	return *(const int *)port;
}

static void flood_close(struct db_port *port)
{
	close(flood_fd(port));
}

static ssize_t flood_read(struct db_port *port, void *bytes, size_t size, db_time now)
{
	(void)now;
	return read(flood_fd(port), bytes, size);
}

static ssize_t flood_write(struct db_port *port, const void *bytes, size_t length, db_time now)
{
	(void)port;
	(void)bytes;
	(void)now;
	return (ssize_t)length;
}

static db_time flood_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                               size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * DB_NS_PER_US;
}

static const struct db_transport flood = {
	.name = "flood",
	.medium = DB_MEDIUM_SERIAL,
	.open = flood_open,
	.close = flood_close,
	.fd = flood_fd,
	.read = flood_read,
	.write = flood_write,
	.wire_time = flood_wire_time,
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
	else if (strstr(record->text, "goes on without its real-time priority"))
		atomic_fetch_add(&lines->lent, 1);
}

/* It turns, its cycle goes on, and its priority is others'; the end of the test is that it ends. */
static void test_flooded(void **state)
{
	const struct db_bus_config config = {
		.name = (char *)"flooded",
		.driver = db_driver_find("vsmd-serial"),
		.transport = &flood,
		.device = (char *)"/dev/zero",
		.baud = 115200,
		.cycle_ms = 1,
		.drive_latency_ms = 30,
		.queue = 1,
		.priority = 1,
		.log = DB_LOG_INFO,
	};
	struct lines lines = { .refused = 0 };
	struct db_bus_stats stats;
	struct db_log *log;
	struct db_bus *bus;
	uint32_t beats;

	(void)state;
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
	db_bus_free(bus);
	db_log_free(log);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_flooded),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
